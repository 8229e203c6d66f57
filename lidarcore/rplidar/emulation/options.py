"""What can be set about the emulated sensor: declared here once, for the command line and for Python."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass

from lidarcore.noise import SensorNoise

FIRST_LINE = "RPLIDAR S1 emulated on "  # and the port: what the emulator prints when it is there

Share = Annotated[float, Field(ge=0, le=1)]
Rpm = Annotated[int, Field(ge=1, le=2000)]
Seconds = Annotated[float, Field(ge=0, le=60)]


@dataclass(config=ConfigDict(extra="forbid"), frozen=True, kw_only=True)
class EmulatorOptions:
    """Settings of the emulated RPLIDAR S1. Raises pydantic's ValidationError for values out of range."""

    link: Annotated[Path | None, Field(description="path of the port; in a private folder if not given")] = (
        None
    )
    replay: Annotated[
        Path | None, Field(description="a raw capture: answer and send as it did, no simulation")
    ] = None
    seed: Annotated[int, Field(ge=0, description="of everything that is random")] = 0

    people: Annotated[int, Field(ge=0, le=20, description="how many walk about the room")] = 2
    moving: Annotated[bool, Field(description="the sensor moves along a path")] = False
    sigma_range: Annotated[float, Field(gt=0, le=1, description="noise of the ranges, m")] = 0.01
    sigma_bearing: Annotated[float, Field(gt=0, le=0.05, description="noise of the bearings, rad")] = 0.001
    range_growth: Annotated[
        float, Field(ge=0, le=0.1, description="times the square of a range: what its noise grows by, 1/m")
    ] = 0.0003
    unevenness: Annotated[
        float, Field(ge=0, le=0.1, description="standard deviation of the walls from straight lines, m")
    ] = 0.004
    unevenness_length: Annotated[
        float, Field(ge=0.005, le=2, description="distance along a wall over which that is alike, m")
    ] = 0.08
    mixed: Annotated[
        Share, Field(description="share of the beams at an edge that report a range between")
    ] = 0.5
    dropouts: Annotated[Share, Field(description="share of the beams without return for no reason")] = 0.003

    rpm: Annotated[Rpm, Field(description="speed until another one is asked for")] = 600
    min_rpm: Annotated[Rpm, Field(description="lowest speed")] = 480
    max_rpm: Annotated[Rpm, Field(description="highest speed")] = 900
    jitter: Annotated[Share, Field(description="standard deviation of the speed, as a share of it")] = 0.002
    spin_up: Annotated[Seconds, Field(description="time from rest to a stable speed, s")] = 0.5
    reset: Annotated[Seconds, Field(description="time for which nothing is answered after RESET, s")] = 2.0
    boot: Annotated[Seconds, Field(description="time for which nothing is answered once plugged in, s")] = 0.0

    baud: Annotated[
        int, Field(ge=1200, le=4_000_000, description="the sensor's; another one gives garbage")
    ] = 256_000
    health: Annotated[int, Field(ge=0, le=2, description="0 good, 1 warning, 2 protection stop")] = 0
    health_code: Annotated[int, Field(ge=0, le=65535, description="code beside the health")] = 0
    health_sticks: Annotated[bool, Field(description="RESET does not mend the health")] = False
    streaming: Annotated[bool, Field(description="scanning already, as after a client that crashed")] = False
    legacy_only: Annotated[bool, Field(description="knows SCAN only: no express scan, no configuration")] = (
        False
    )
    silent_conf: Annotated[
        bool, Field(description="leaves every question about configuration unanswered")
    ] = False

    flip: Annotated[Share, Field(description="share of the packets with a bit flipped")] = 0.0
    lose: Annotated[Share, Field(description="share of the packets that are lost")] = 0.0
    lose_bytes: Annotated[Share, Field(description="share of the bytes that are lost")] = 0.0

    @property
    def noise(self) -> SensorNoise:
        """What a fitter should know of it."""
        return SensorNoise(
            self.sigma_range,
            self.sigma_bearing,
            range_growth=self.range_growth,
            unevenness=self.unevenness,
            unevenness_length=self.unevenness_length,
            renewal=0.0,
            resampling=1.0,
        )

    def arguments(self) -> list[str]:
        """The command line that `parse` turns into these options."""
        given = {name: value for name, value in vars(self).items() if value != _FIELDS[name].default}
        return [_flag(name) if value is True else f"{_flag(name)}={value}" for name, value in given.items()]


def parse(arguments: Sequence[str], program: str) -> EmulatorOptions:
    """The options of a command line; says what is wrong with it and exits if it cannot be understood."""
    parser = argparse.ArgumentParser(program, description=_DESCRIPTION, epilog=_COMMANDS)
    for name, field in _FIELDS.items():
        if field.annotation is bool:
            parser.add_argument(_flag(name), action="store_true", help=field.description)
        else:
            default = "" if field.default is None else f" (default {field.default})"
            parser.add_argument(
                _flag(name),
                default=field.default,
                metavar=_METAVARS.get(field.annotation, "X"),
                help=field.description + default,
            )
    chosen = vars(parser.parse_args(arguments))
    try:
        return EmulatorOptions(**chosen)
    except ValidationError as error:
        parser.error("; ".join(f"{_flag(str(e['loc'][0]))} {e['input']}: {e['msg']}" for e in error.errors()))


def _flag(name: str) -> str:
    return "--" + name.replace("_", "-")


_METAVARS = {int: "N", Path | None: "PATH"}
_FIELDS: Any = EmulatorOptions.__pydantic_fields__  # type: ignore[attr-defined]
_DESCRIPTION = """Emulate an RPLIDAR S1 on a pseudo-terminal: its port is in the first line printed."""
_COMMANDS = """While it runs it reads commands from standard input and answers each with a line: unplug; replug;
stall SECONDS; flip, lose or lose-bytes SHARE; garbage BYTES; health STATUS [CODE]; quit."""
