"""What plays: a sensor, the emulator or a recording, and the transport controls."""

from typing import Annotated, Any

from fastapi import APIRouter, Body
from typing_extensions import TypedDict

from lidarcore import DeviceError
from lidarcore.simulation.settings import SimulationSettings
from lidarcore.simulation.worlds import WORLDS

from ...pipeline.runtime import Runtime
from ...sources.live import DeviceOptions, LiveSource, Taps
from ...sources.player import SourceStatus
from ...sources.recorded import RecordingSource
from ...sources.simulated import SimulationSource
from ...sources.source import Source
from ..dependencies import Server
from ..openapi import formats
from ..problems import documented
from ..requests.source_bodies import SIMULATION_SETTINGS, Choice, Recording, Simulation, Step, Transport

router = APIRouter(prefix="/source", tags=["source"])


class WorldJson(TypedDict):
    name: str
    title: str
    paths: list[str]


class SimulationJson(TypedDict):
    """`schema` is a JSON schema of the settings: meaning, unit, range and default of each."""

    worlds: list[WorldJson]
    schema: dict[str, Any]


SIMULATION: SimulationJson = {
    "worlds": [
        {"name": name, "title": place.title, "paths": list(place.paths)} for name, place in WORLDS.items()
    ],
    "schema": SIMULATION_SETTINGS.json_schema()
    | {"default": SIMULATION_SETTINGS.dump_python(SimulationSettings(), mode="json")},
}


@router.get("", response_description="What plays, where it is, and how")
def read(server: Server) -> SourceStatus:
    """What plays, where it is, and how."""
    return server.runtime.player.status()


@router.put("", response_description="What plays now", responses=documented(403, 404, 409, 422, 503, 504))
def play(
    server: Server,
    choice: Choice,
) -> SourceStatus:
    """Play a sensor, the emulator or a recording; a recording of the source before ends. If it fails, that goes on.

    409 with the member `topics` if the recording has several lidar topics and none was chosen.
    """
    if isinstance(choice, Recording):
        source: Source = RecordingSource(server.library.path(choice.name), choice.topic)
        index, paused = choice.index, choice.paused
    elif isinstance(choice, Simulation):
        source, index, paused = SimulationSource(choice.settings, server.taps.scan), 0, False
    else:
        options = DeviceOptions(**choice.model_dump(exclude={"kind"}), emulated=choice.kind == "emulator")
        source, index, paused = _live(server.runtime, options, server.taps), 0, False
    server.recorder.stop()
    server.runtime.open(source, index, paused)
    return server.runtime.player.status()


@router.get(
    "/simulation",
    response_description="Worlds, and a JSON schema of the settings",
    responses=formats(json=SIMULATION),
)
def simulation() -> SimulationJson:
    """Where a simulated robot can drive, and what can be set about it."""
    return SIMULATION


def _live(runtime: Runtime, options: DeviceOptions, taps: Taps) -> LiveSource:
    """The sensor; the one that plays has to let go of its port first, and gets it back if that fails."""
    playing = runtime.player.source
    if options.emulated or not isinstance(playing, LiveSource) or not playing.holds(options.port):
        return LiveSource(options, taps)
    playing.close()
    try:
        return LiveSource(options, taps)
    except DeviceError:
        runtime.open(LiveSource(playing.options, taps))
        raise


@router.patch("", response_description="What plays, as it is now", responses=documented(422))
def control(
    server: Server,
    transport: Annotated[
        Transport, Body(examples=[{"state": "paused", "index": 41}, {"speed": 2.0, "loop": False}])
    ],
) -> SourceStatus:
    """Play, pause, seek, set speed and loop; or how fast the sensor turns."""
    if transport.rpm is not None:
        server.runtime.player.source.set_speed(transport.rpm)
    server.runtime.player.control(transport.state, transport.index, transport.speed, transport.loop)
    return server.runtime.player.status()


@router.post("/step", response_description="What plays, as it is now", responses=documented(422))
def step(server: Server, step: Annotated[Step, Body(examples=[{"by": -1}])]) -> SourceStatus:
    """Pause, and go some scans on or back."""
    server.runtime.player.step(step.by)
    return server.runtime.player.status()
