"""What the routes need, taken from the app they run in."""

from typing import Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection

from app.calibration import LiveCalibration
from app.frame import Frame
from app.landmark_store import LandmarkStore
from app.library import Library
from app.live import Taps
from app.problems import ProblemError
from app.profiles import Profiles
from app.recorder import AsyncRecorder
from app.repeatability import LiveRepeatability
from app.runtime import Runtime
from app.stream import Hub
from app.studies import Studies


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


def _repeatability(connection: HTTPConnection) -> LiveRepeatability:
    repeatability: LiveRepeatability = connection.app.state.repeatability
    return repeatability


def _calibration(connection: HTTPConnection) -> LiveCalibration:
    calibration: LiveCalibration = connection.app.state.calibration
    return calibration


def _profiles(connection: HTTPConnection) -> Profiles:
    profiles: Profiles = connection.app.state.profiles
    return profiles


def _studies(connection: HTTPConnection) -> Studies:
    studies: Studies = connection.app.state.studies
    return studies


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
CurrentRepeatability = Annotated[LiveRepeatability, Depends(_repeatability)]
CurrentCalibration = Annotated[LiveCalibration, Depends(_calibration)]
CurrentProfiles = Annotated[Profiles, Depends(_profiles)]
CurrentStudies = Annotated[Studies, Depends(_studies)]
CurrentFrame = Annotated[Frame, Depends(_frame)]
