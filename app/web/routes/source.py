"""What plays: a sensor, the emulator or a recording, and the transport controls."""

import json
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Body
from pydantic import AfterValidator, BeforeValidator, Field, TypeAdapter
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
from ..schemas import Body as Model
from ..schemas import Number, StrictBody

router = APIRouter(prefix="/source", tags=["source"])

Index = Annotated[int, Field(ge=0, le=10**9, description="number of the scan, from 0")]
Speed = Annotated[Number, Field(le=100, json_schema_extra={"anyOf": [{"const": 0}, {"minimum": 0.1}]})]


def _runs(speed: float) -> float:
    if 0 < speed < 0.1 or speed < 0:
        raise ValueError(f"{speed:g} is neither 0 nor from 0.1 to 100")
    return speed


Rpm = Annotated[int | None, Field(description="speed of the motor; 600 if not given")]
Mode = Annotated[str | None, Field(description="scan mode; the one the sensor recommends if not given")]


class Device(StrictBody):
    """A sensor at a port."""

    kind: Literal["device"]
    port: str | None = Field(
        None, description="path or name of the port; the only sensor connected if not given"
    )
    baud: Annotated[int, Field(ge=1200, le=4_000_000)] | None = Field(None, description="256000 if not given")
    mode: Mode = None
    rpm: Rpm = None


class Emulator(StrictBody):
    """An emulated RPLIDAR S1 on a pseudo-terminal, read by the same driver as a real one."""

    kind: Literal["emulator"]
    mode: Mode = None
    rpm: Rpm = None


_SIMULATION = TypeAdapter(SimulationSettings)


def _strictly(settings: object) -> object:
    """Settings, checked as JSON: in Python, strict would also refuse what a dictionary says of a record."""
    return (
        _SIMULATION.validate_json(json.dumps(settings), strict=True)
        if isinstance(settings, dict)
        else settings
    )


class Simulation(Model):
    """A simulated robot with odometry, whose true pose is known; GET /source/simulation describes its settings."""

    kind: Literal["simulation"]
    settings: Annotated[SimulationSettings, BeforeValidator(_strictly)] = Field(
        default_factory=SimulationSettings
    )


class Recording(StrictBody):
    """A recording of the folder."""

    kind: Literal["recording"]
    name: str
    topic: str | None = Field(None, description="needed if the recording has several lidar topics")
    index: Index = 0
    paused: bool = False


class Transport(StrictBody):
    """What to change; what is left out stays."""

    state: Literal["playing", "paused"] | None = None
    index: Index | None = None
    speed: Annotated[Speed, AfterValidator(_runs)] | None = Field(
        None, description="times as fast as recorded; 0: as fast as possible"
    )
    loop: bool | None = None
    rpm: int | None = Field(None, description="speed of the sensor's motor")


class Step(StrictBody):
    """How many scans to go on, or back if negative."""

    by: Annotated[int, Field(ge=-600, le=600)] = 1


Choice = Annotated[
    Device | Emulator | Simulation | Recording,
    Body(
        discriminator="kind",
        examples=[
            {"kind": "device", "port": "/dev/ttyUSB0"},
            {"kind": "simulation", "settings": {"world": "two rooms"}},
            {"kind": "emulator"},
            {"kind": "recording", "name": "demo.bag"},
        ],
    ),
]


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
    "schema": _SIMULATION.json_schema()
    | {"default": _SIMULATION.dump_python(SimulationSettings(), mode="json")},
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
