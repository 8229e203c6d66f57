"""What requests say of the source: which one to play, and how it goes on."""

import json
from typing import Annotated, Literal

from fastapi import Body
from pydantic import AfterValidator, BeforeValidator, Field, TypeAdapter

from lidarcore.simulation.settings import SimulationSettings

from ..schemas import Body as Model
from ..schemas import Number, StrictBody

Index = Annotated[int, Field(ge=0, le=10**9, description="number of the scan, from 0")]


def _runs(speed: float) -> float:
    if 0 < speed < 0.1 or speed < 0:
        raise ValueError(f"{speed:g} is neither 0 nor from 0.1 to 100")
    return speed


Speed = Annotated[
    Number,
    Field(le=100, json_schema_extra={"anyOf": [{"const": 0}, {"minimum": 0.1}]}),
    AfterValidator(_runs),
]
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


SIMULATION_SETTINGS = TypeAdapter(SimulationSettings)


def _strictly(settings: object) -> object:
    """Settings, checked as JSON: in Python, strict would also refuse what a dictionary says of a record."""
    return (
        SIMULATION_SETTINGS.validate_json(json.dumps(settings), strict=True)
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
    speed: Speed | None = Field(None, description="times as fast as recorded; 0: as fast as possible")
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
