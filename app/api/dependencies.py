"""What the routes need, taken from the app they run in."""

from typing import Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection

from app.frame import Frame
from app.landmark_store import LandmarkStore
from app.library import Library
from app.live import Taps
from app.problems import ProblemError
from app.recorder import AsyncRecorder
from app.runtime import Runtime
from app.stream import Hub


def _runtime(connection: HTTPConnection) -> Runtime:
    runtime: Runtime = connection.app.state.runtime
    return runtime


def _library(connection: HTTPConnection) -> Library:
    library: Library = connection.app.state.library
    return library


def _hub(connection: HTTPConnection) -> Hub:
    hub: Hub = connection.app.state.hub
    return hub


def _recorder(connection: HTTPConnection) -> AsyncRecorder:
    recorder: AsyncRecorder = connection.app.state.recorder
    return recorder


def _taps(connection: HTTPConnection) -> Taps:
    taps: Taps = connection.app.state.taps
    return taps


async def _landmarks(connection: HTTPConnection) -> LandmarkStore:
    landmarks: LandmarkStore = connection.app.state.landmarks
    return landmarks


def _frame(runtime: Annotated[Runtime, Depends(_runtime)]) -> Frame:
    if runtime.frame is None:
        why = "no scan has been processed" if runtime.ready else "the kernels are still being compiled"
        raise ProblemError(404, f"There is no frame yet: {why}.")
    return runtime.frame


CurrentRuntime = Annotated[Runtime, Depends(_runtime)]
CurrentLibrary = Annotated[Library, Depends(_library)]
CurrentHub = Annotated[Hub, Depends(_hub)]
CurrentRecorder = Annotated[AsyncRecorder, Depends(_recorder)]
CurrentTaps = Annotated[Taps, Depends(_taps)]
CurrentLandmarks = Annotated[LandmarkStore, Depends(_landmarks)]
CurrentFrame = Annotated[Frame, Depends(_frame)]
