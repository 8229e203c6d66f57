"""How corners and walls scatter while the sensor stands still, against what each method claims."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Annotated, Literal

from fastapi import APIRouter, Query
from pydantic import TypeAdapter
from starlette.responses import Response

from lidarcore import Array
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.repeatability.summary import Summary
from lidarcore.evaluation.repeatability.tables import to_csv

from ...errors import NotFoundError
from ..problems import documented, encode
from ..repeatability_schemas import DeviationsJson, RepeatabilityJson
from .dependencies import CurrentRepeatability, CurrentRuntime
from .examples import Json, ok

router = APIRouter(prefix="/repeatability", tags=["repeatability"])

OFF = "No scans are compared: set repeatability.running to true while the sensor stands still."
JUDGEMENT = {
    "area_ratio": {"value": 0.98, "low": 0.93, "high": 1.03},
    "coverage_50": {"value": 0.492, "low": 0.468, "high": 0.516},
    "coverage_95": {"value": 0.947, "low": 0.935, "high": 0.957},
    "coverage_99": {"value": 0.988, "low": 0.981, "high": 0.993},
}
COVARIANCE = [[1.68e-05, -3.1e-06], [-3.1e-06, 1.37e-05]]
CLAIM: Json = {
    "areas": {
        "low": 3.9e-05, "first_quartile": 4.2e-05, "median": 4.3e-05, "third_quartile": 4.5e-05, "high": 4.9e-05,
        "outliers": [6.1e-05], "scans": 100,
    },
    "judgement": JUDGEMENT,
    "verdict": "true",
}  # fmt: skip
CORNER: Json = {
    "id": 3,
    "count": 97,
    "mean": [3.1042, 1.9873],
    "scatter": [[1.71e-05, -2.9e-06], [-2.9e-06, 1.41e-05]],
    "area": 4.8e-05,
    "claims": {
        kind: {"covariance": COVARIANCE, "area": 4.7e-05, "judgement": JUDGEMENT}
        for kind in ("published", "consistent")
    },
}
METHOD: Json = {
    "name": "ml",
    "actual_area": 4.4e-05,
    "claims": {"published": CLAIM, "consistent": CLAIM},
    "corners": [CORNER],
}
WALL_CLAIM: Json = CLAIM | {
    "areas": {
        "low": 2.9e-06, "first_quartile": 3.2e-06, "median": 3.4e-06, "third_quartile": 3.6e-06, "high": 4.0e-06,
        "outliers": [], "scans": 100,
    },
}  # fmt: skip
WALL_COVARIANCE = [[2.2e-06, 8.0e-07], [8.0e-07, 8.1e-07]]
WALL: Json = {
    "id": 7,
    "count": 100,
    "mean": [1.5713, 2.4021],
    "scatter": [[2.1e-06, 7.5e-07], [7.5e-07, 8.4e-07]],
    "area": 3.4e-06,
    "claims": {
        kind: {"covariance": WALL_COVARIANCE, "area": 3.4e-06, "judgement": JUDGEMENT}
        for kind in ("published", "consistent")
    },
}
WALLS: Json = {
    "window": 100,
    "scans": 100,
    "message": None,
    "methods": [
        {
            "name": "ml",
            "actual_area": 3.4e-06,
            "claims": {"published": WALL_CLAIM, "consistent": WALL_CLAIM},
            "walls": [WALL],
        }
    ],
}
SUMMARY: Json = {
    "running": True,
    "window": 100,
    "scans": 100,
    "message": None,
    "methods": [METHOD],
    "walls": WALLS,
}
DEVIATIONS = {"id": 3, "deviations": {"ml": [[0.0021, -0.0034], [-0.0017, 0.0008]]}}
WALL_DEVIATIONS = {"id": 7, "deviations": {"ml": [[0.0012, -0.0007], [-0.0021, 0.0011]]}}

FOUND = ok(SUMMARY, "What the window says", csv="of,fitter,covariance,scans,judged,actual_area,verdict,...")


@dataclass(frozen=True, slots=True)
class _Told(Summary):
    """A summary, and whether scans are added to it."""

    running: bool


_TOLD = TypeAdapter(_Told)  # it knows the types, and so takes a quarter of the time of `to_json`


@router.get("", response_model=RepeatabilityJson, responses=FOUND | documented(422))
def read(
    runtime: CurrentRuntime,
    repeatability: CurrentRepeatability,
    format: Annotated[
        Literal["json", "csv"], Query(description="JSON, or CSV: a line for each method and covariance")
    ] = "json",
) -> Response:
    """The scatter of corners and walls over the last scans against the ellipses that each method claims.

    Switched on by the setting `repeatability.running`. The window starts over when the source, or a setting of the
    extraction, changes, when a recording goes on elsewhere, and when the sensor is moved.
    """
    summary, running = repeatability.summary(), runtime.settings.repeatability.running
    if format == "csv":
        return Response(to_csv(summary), media_type="text/csv")
    found = {field.name: getattr(summary, field.name) for field in fields(summary)}
    if not running and not summary.scans:
        found["message"] = OFF
    return Response(_TOLD.dump_json(_Told(**found, running=running)), media_type="application/json")


@router.delete("", status_code=204)
def clear(repeatability: CurrentRepeatability) -> None:
    """Start over: forget the scans of the window, for instance after the sensor was moved."""
    repeatability.clear()


@router.get(
    "/corners/{id}",
    response_model=DeviationsJson,
    responses=ok(DEVIATIONS, "Where the corner was seen") | documented(404, 422),
)
def corner(repeatability: CurrentRepeatability, id: int) -> Response:
    """Where each method saw one corner of the window: the dots that the claimed ellipses should hold."""
    return _deviations(id, repeatability.deviations)


@router.get(
    "/walls/{id}",
    response_model=DeviationsJson,
    responses=ok(WALL_DEVIATIONS, "How the wall was seen") | documented(404, 422),
)
def wall(repeatability: CurrentRepeatability, id: int) -> Response:
    """The alpha (rad) and r (m) that each method gave one wall of the window, from their mean."""
    return _deviations(id, repeatability.wall_deviations)


def _deviations(id: int, deviations: Callable[[int], dict[str, Array]]) -> Response:
    try:
        found = deviations(id)
    except EvaluationError as error:
        raise NotFoundError(str(error)) from error
    return encode({"id": id, "deviations": {name: pairs.tolist() for name, pairs in found.items()}})
