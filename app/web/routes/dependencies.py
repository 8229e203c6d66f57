"""What the routes need of the server that they run in."""

from collections.abc import Callable
from typing import Annotated, Any

from anyio import CapacityLimiter
from fastapi import Depends
from starlette.requests import HTTPConnection

from ...errors import NotFoundError
from ...jobs.calibration import LiveCalibration
from ...jobs.landmark_store import LandmarkStore
from ...jobs.profiles import Profiles
from ...jobs.recorder import AsyncRecorder
from ...jobs.repeatability import LiveRepeatability
from ...jobs.studies import Studies
from ...pipeline.frame import Frame
from ...pipeline.runtime import Runtime
from ...sources.library import Library
from ...sources.live import Taps
from ..state import State
from ..stream import Hub


def _of(part: Callable[[State], object]) -> Any:
    """A part of the server; on the event loop, since nothing waits."""

    async def find(connection: HTTPConnection) -> object:
        return part(connection.app.state.server)

    return Depends(find)


def _frame(state: State) -> Frame:
    if state.runtime.frame is None:
        why = "no scan has been processed" if state.runtime.ready else "the kernels are still being compiled"
        raise NotFoundError(f"There is no frame yet: {why}.")
    return state.runtime.frame


async def _heavy(connection: HTTPConnection) -> CapacityLimiter:
    limiter: CapacityLimiter = connection.app.state.heavy
    return limiter


Heavy = Annotated[CapacityLimiter, Depends(_heavy)]
"""What takes much memory or time is made for one request at a time; the others wait without a thread."""

CurrentRuntime = Annotated[Runtime, _of(lambda state: state.runtime)]
CurrentLibrary = Annotated[Library, _of(lambda state: state.library)]
CurrentHub = Annotated[Hub, _of(lambda state: state.hub)]
CurrentRecorder = Annotated[AsyncRecorder, _of(lambda state: state.recorder)]
CurrentTaps = Annotated[Taps, _of(lambda state: state.taps)]
CurrentLandmarks = Annotated[LandmarkStore, _of(lambda state: state.landmarks)]
CurrentRepeatability = Annotated[LiveRepeatability, _of(lambda state: state.repeatability)]
CurrentCalibration = Annotated[LiveCalibration, _of(lambda state: state.calibration)]
CurrentProfiles = Annotated[Profiles, _of(lambda state: state.profiles)]
CurrentStudies = Annotated[Studies, _of(lambda state: state.studies)]
CurrentFrame = Annotated[Frame, _of(_frame)]
