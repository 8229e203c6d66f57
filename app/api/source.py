"""What plays: the simulation or a recording, and the transport controls."""

from typing import Annotated, Literal

from fastapi import APIRouter, Body
from pydantic import BaseModel, ConfigDict, Field

from app.api.dependencies import CurrentLibrary, CurrentRuntime
from app.api.examples import SOURCE, ok
from app.player import SourceJson
from app.problems import documented
from app.sources import RecordingSource, SimulationSource

router = APIRouter(prefix="/source", tags=["source"])

Index = Annotated[int, Field(ge=0, le=10**9, description="number of the scan, from 0")]
Speed = Annotated[float, Field(ge=0.1, le=100, allow_inf_nan=False)]


class _Body(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class Simulation(_Body):
    """The built-in simulated room."""

    kind: Literal["simulation"]
    paused: bool = False


class Recording(_Body):
    """A recording of the folder."""

    kind: Literal["recording"]
    name: str
    topic: str | None = Field(None, description="needed if the recording has several lidar topics")
    index: Index = 0
    paused: bool = False


class Transport(_Body):
    """What to change; what is left out stays."""

    state: Literal["playing", "paused"] | None = None
    index: Index | None = None
    speed: Literal[0] | Speed | None = Field(
        None, description="times as fast as recorded; 0: as fast as possible"
    )
    loop: bool | None = None


class Step(_Body):
    """How many scans to go on, or back if negative."""

    by: Annotated[int, Field(ge=-600, le=600)] = 1


Choice = Annotated[
    Simulation | Recording,
    Body(discriminator="kind", examples=[{"kind": "recording", "name": "demo.bag"}, {"kind": "simulation"}]),
]


@router.get("", responses=ok(SOURCE, "What plays, where it is, and how"))
def read(runtime: CurrentRuntime) -> SourceJson:
    """What plays, where it is, and how."""
    return runtime.player.describe()


@router.put("", responses=ok(SOURCE, "What plays now") | documented(404, 409, 422))
def play(runtime: CurrentRuntime, library: CurrentLibrary, choice: Choice) -> SourceJson:
    """Play the simulation or a recording. If that fails, what played before goes on.

    409 with the member `topics` if the recording has several lidar topics and none was chosen.
    """
    if isinstance(choice, Simulation):
        runtime.open(SimulationSource(), paused=choice.paused)
    else:
        source = RecordingSource(library.path(choice.name), choice.topic)
        runtime.open(source, choice.index, choice.paused)
    return runtime.player.describe()


@router.patch("", responses=ok(SOURCE, "What plays, as it is now") | documented(422))
def control(
    runtime: CurrentRuntime,
    transport: Annotated[
        Transport, Body(examples=[{"state": "paused", "index": 41}, {"speed": 2.0, "loop": False}])
    ],
) -> SourceJson:
    """Play, pause, seek, set speed and loop."""
    runtime.player.control(transport.state, transport.index, transport.speed, transport.loop)
    return runtime.player.describe()


@router.post("/step", responses=ok(SOURCE, "What plays, as it is now") | documented(422))
def step(runtime: CurrentRuntime, step: Annotated[Step, Body(examples=[{"by": -1}])]) -> SourceJson:
    """Pause, and go some scans on or back."""
    runtime.player.step(step.by)
    return runtime.player.describe()
