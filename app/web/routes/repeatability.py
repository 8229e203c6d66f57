"""How corners and walls scatter while the sensor stands still, against what each method claims."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Annotated, Literal

from fastapi import APIRouter, Query
from pydantic import TypeAdapter
from starlette.responses import Response
from typing_extensions import TypedDict

from lidarcore import Array
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.repeatability.summary import Summary
from lidarcore.evaluation.repeatability.tables import to_csv

from ...errors import NotFoundError
from ..answers.downloads import file_of
from ..dependencies import Server
from ..openapi import formats
from ..problems import documented, encode
from ..schemas import Pair

router = APIRouter(prefix="/repeatability", tags=["repeatability"])

OFF = "No scans are compared: set repeatability.running to true while the sensor stands still."
CSV = "of,fitter,covariance,scans,judged,actual_area,verdict,..."


@dataclass(frozen=True, slots=True)
class RepeatabilityJson(Summary):
    """What the last `scans` scans say of corners, of at most `window`; `message` tells what is wrong.

    `running` tells whether scans are added; the ids of corners and walls are not those of a frame.
    """

    running: bool


class DeviationsJson(TypedDict):
    """Where each method saw a corner (x, y; m), or a wall (alpha, r; rad and m), from its mean, the oldest first."""

    id: int
    deviations: dict[str, list[Pair]]


_JSON = TypeAdapter(RepeatabilityJson)  # it knows the types, and so takes a quarter of the time of `to_json`


@router.get(
    "",
    response_model=RepeatabilityJson,
    response_description="What the window says",
    responses=formats(csv=CSV) | documented(422),
)
def read(
    server: Server,
    format: Annotated[
        Literal["json", "csv"], Query(description="JSON, or CSV: a line for each method and covariance")
    ] = "json",
) -> Response:
    """The scatter of corners and walls over the last scans against the ellipses that each method claims.

    Switched on by the setting `repeatability.running`. The window starts over when the source, or a setting of the
    extraction, changes, when a recording goes on elsewhere, and when the sensor is moved.
    """
    summary, running = server.repeatability.summary(), server.runtime.settings.repeatability.running
    if format == "csv":
        return file_of(to_csv(summary), "csv", "repeatability")
    found = {field.name: getattr(summary, field.name) for field in fields(summary)}
    if not running and not summary.scans:
        found["message"] = OFF
    return Response(
        _JSON.dump_json(RepeatabilityJson(**found, running=running)), media_type="application/json"
    )


@router.delete("", status_code=204)
def clear(server: Server) -> None:
    """Start over: forget the scans of the window, for instance after the sensor was moved."""
    server.repeatability.clear()


@router.get(
    "/corners/{id}",
    response_model=DeviationsJson,
    response_description="Where the corner was seen",
    responses=documented(404, 422),
)
def corner(server: Server, id: int) -> Response:
    """Where each method saw one corner of the window: the dots that the claimed ellipses should hold."""
    return _deviations(id, server.repeatability.deviations)


@router.get(
    "/walls/{id}",
    response_model=DeviationsJson,
    response_description="How the wall was seen",
    responses=documented(404, 422),
)
def wall(server: Server, id: int) -> Response:
    """The alpha (rad) and r (m) that each method gave one wall of the window, from their mean."""
    return _deviations(id, server.repeatability.wall_deviations)


def _deviations(id: int, deviations: Callable[[int], dict[str, Array]]) -> Response:
    try:
        found = deviations(id)
    except EvaluationError as error:
        raise NotFoundError(str(error)) from error
    return encode({"id": id, "deviations": {name: pairs.tolist() for name, pairs in found.items()}})
