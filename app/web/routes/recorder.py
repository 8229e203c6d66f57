"""Recording the sensor that plays."""

from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Body
from pydantic import Field

from ...errors import ConflictError
from ...jobs.recorder import RecorderStatus
from ...sources.live import LiveSource
from ..dependencies import Server
from ..problems import documented
from ..schemas import StrictBody

router = APIRouter(prefix="/recorder", tags=["recorder"])

SUFFIX, RAW_SUFFIX = ".mcap", ".rplidar"


class RecordingStart(StrictBody):
    """What to record."""

    name: str | None = Field(
        None, description="file name in the recordings folder; date and time if not given"
    )
    raw: bool = Field(False, description="also the bytes from the port, in a file of their own")


@router.get("", response_description="What is recorded, or was recorded last")
def read(server: Server) -> RecorderStatus:
    """What is recorded, or was recorded last."""
    return server.recorder.status


@router.post("/start", response_description="What is recorded now", responses=documented(409, 422, 507))
def start(
    server: Server,
    start: Annotated[RecordingStart, Body(examples=[{}, {"name": "hall.mcap", "raw": True}])],
) -> RecorderStatus:
    """Record the live source from now on into the recordings folder, as MCAP that ROS 2 tools open."""
    source = server.runtime.player.source
    if not source.live:
        raise ConflictError("A recording is playing: only a live source can be recorded.")
    sensor = source if isinstance(source, LiveSource) else None
    if start.raw and sensor is None:
        raise ConflictError("A simulation has no port, and so no bytes to record: leave raw out.")
    name = start.name or f"{datetime.now():%Y-%m-%d_%H-%M-%S}"
    path = server.library.new(name if name.endswith(SUFFIX) else name + SUFFIX)
    raw = server.library.new(path.stem + RAW_SUFFIX) if start.raw else None
    scale = server.runtime.settings.view.ellipse_scale
    stream, model = (sensor.stream, sensor.device().name) if sensor else (None, "simulated robot")
    server.recorder.start(path, raw=raw, stream=stream, sensor=model, ellipse_scale=scale)
    server.runtime.announce()
    return server.recorder.status


@router.post("/stop", response_description="What was recorded")
def stop(server: Server) -> RecorderStatus:
    """End the recording; without one this does nothing."""
    status = server.recorder.stop()
    server.runtime.announce()
    return status
