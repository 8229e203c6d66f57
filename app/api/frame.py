"""The current frame, its segments and its corners."""

from collections.abc import Callable
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, WebSocket
from starlette.responses import Response

from app.api.dependencies import CurrentFrame, CurrentHub
from app.api.examples import CORNER, FRAME, SEGMENT, ok
from app.frame import Frame, segments_json
from app.problems import ProblemError, documented, encode
from app.tables import Columns, corner_columns, csv_text, segment_columns
from app.wire import CornerJson, FrameJson, SegmentJson
from lidarcore import Features

router = APIRouter(tags=["frame"], responses=documented(404, 422))

Fitter = Annotated[
    str | None, Query(description="a method of the frame; the main one if not given", examples=["ml"])
]
Format = Annotated[Literal["json", "csv"], Query(description="JSON, or CSV with a header")]
Points = Annotated[bool, Query(description="with the measured points")]


@router.get("/frame", response_model=FrameJson, responses=ok(FRAME, "The newest frame"))
def frame(frame: CurrentFrame, points: Points = False) -> Response:
    """Everything found in the newest scan, by every method that runs."""
    return Response(frame.text_with_points if points else frame.text, media_type="application/json")


def _with_csv(example: object, header: str, description: str) -> dict[int | str, dict[str, Any]]:
    responses = ok(example, description)
    responses[200]["content"]["text/csv"] = {"example": header}
    return responses


@router.get(
    "/segments",
    response_model=list[SegmentJson],
    responses=_with_csv([SEGMENT], "id,alpha,r,x_start,y_start,...", "The segments of the newest scan"),
)
def segments(frame: CurrentFrame, fitter: Fitter = None, format: Format = "json") -> Response:
    """The segments by one method, in the order of the ring. Metres and radians, sensor frame."""
    found = _features(frame, fitter)
    if format == "csv":
        return _csv(list(range(len(found.segments))), segment_columns, found)
    return encode(segments_json(found))


@router.get(
    "/corners",
    response_model=list[CornerJson],
    responses=_with_csv([CORNER], "id,segment_1,segment_2,x,y,...", "The corners of the newest scan"),
)
def corners(frame: CurrentFrame, fitter: Fitter = None, format: Format = "json") -> Response:
    """The corners that one method found; ids last from frame to frame. Metres and radians, sensor frame."""
    found, name = _features(frame, fitter), fitter or next(iter(frame.features))
    rows = sorted((row for row in frame.corners if name in row.index), key=lambda row: row.index[name])
    if format == "csv":
        return _csv([row.id for row in rows], corner_columns, found)
    wanted = {row.id for row in rows}
    only = [
        row | {"by_method": {name: row["by_method"][name]}}
        for row in frame.corners_json()
        if row["id"] in wanted
    ]
    return encode(only)


@router.websocket("/stream")
async def stream(websocket: WebSocket, hub: CurrentHub, points: Points = False) -> None:
    """Frames and changes of state as they happen, newest first; a slow client gets fewer, never old ones."""
    await websocket.accept()
    await hub.serve(websocket, points)


def _features(frame: Frame, fitter: str | None) -> Features:
    if fitter is None:
        return frame.main
    if fitter not in frame.features:
        has = ", ".join(frame.features)
        raise ProblemError(
            404, f"The frame has no {fitter!r}, only {has}: set it as fitter, or compare with it."
        )
    return frame.features[fitter]


def _csv(ids: list[int], columns: Callable[[Features], Columns], features: Features) -> Response:
    return Response(csv_text({"id": ids, **columns(features)}), media_type="text/csv")
