"""How the corners scatter while the sensor stands still, against what each method claims."""

from dataclasses import fields
from typing import Annotated, Literal

from fastapi import APIRouter, Query
from pydantic_core import to_json
from starlette.responses import Response

from app.api.dependencies import CurrentRepeatability, CurrentRuntime
from app.api.examples import Json, ok
from app.problems import ProblemError, documented, encode
from app.repeatability_wire import DeviationsJson, RepeatabilityJson
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.repeatability_tables import to_csv

router = APIRouter(prefix="/repeatability", tags=["repeatability"])

OFF = "No scans are watched: set repeatability.running to true while the sensor stands still."
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
SUMMARY: Json = {"running": True, "window": 100, "scans": 100, "message": None, "methods": [METHOD]}
DEVIATIONS = {"id": 3, "deviations": {"ml": [[0.0021, -0.0034], [-0.0017, 0.0008]]}}

FOUND = ok(SUMMARY, "What the window says")
FOUND[200]["content"]["text/csv"] = {"example": "fitter,covariance,scans,corners,actual_area,verdict,..."}


@router.get("", response_model=RepeatabilityJson, responses=FOUND | documented(422))
def read(
    runtime: CurrentRuntime,
    repeatability: CurrentRepeatability,
    format: Annotated[
        Literal["json", "csv"], Query(description="JSON, or CSV: a line for each method and covariance")
    ] = "json",
) -> Response:
    """The scatter of the corners over the last scans against the ellipses that each method claims.

    Switched on by the setting `repeatability.running`. The window begins anew when the source, or a setting of the
    extraction, changes, when a recording goes on elsewhere, and when the sensor is moved.
    """
    summary, running = repeatability.summary(), runtime.settings.repeatability.running
    if format == "csv":
        return Response(to_csv(summary), media_type="text/csv")
    found = {field.name: getattr(summary, field.name) for field in fields(summary)}
    if not running and not summary.scans:
        found["message"] = OFF
    return Response(
        to_json({"running": running, **found}, inf_nan_mode="null"), media_type="application/json"
    )


@router.delete("", status_code=204)
def clear(repeatability: CurrentRepeatability) -> None:
    """Begin anew: forget the scans of the window, for instance after the sensor was moved."""
    repeatability.clear()


@router.get(
    "/corners/{id}",
    response_model=DeviationsJson,
    responses=ok(DEVIATIONS, "Where the corner was seen") | documented(404, 422),
)
def corner(repeatability: CurrentRepeatability, id: int) -> Response:
    """Where each method saw one corner of the window: the dots that the claimed ellipses should hold."""
    try:
        deviations = repeatability.deviations(id)
    except EvaluationError as error:
        raise ProblemError(404, str(error)) from error
    return encode({"id": id, "deviations": {name: xy.tolist() for name, xy in deviations.items()}})
