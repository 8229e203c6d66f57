"""What can be set about the emulated sensor: declared here once, for the command line and for Python."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass

from lidarcore.noise import SensorNoise

FIRST_LINE = "RPLIDAR S1 emulated on "  # and the port: what the emulator prints when it is there

_RPM = {"ge": 1, "le": 2000}
_SECONDS = {"ge": 0, "le": 60}


def _option(default: Any, text: str, **bounds: Any) -> Any:
    return Field(default, description=text, kw_only=True, **bounds)


def _share(default: float, text: str) -> Any:
    return _option(default, text, ge=0, le=1)


@dataclass(config=ConfigDict(extra="forbid"), frozen=True, kw_only=True)
class EmulatorOptions:
    """Settings of the emulated RPLIDAR S1. Raises pydantic's ValidationError for values out of range."""

    link: Path | None = _option(None, "path of the port; in a private folder if not given")
    replay: Path | None = _option(None, "a raw capture: answer and send as it did, no simulation")
    seed: int = _option(0, "of everything that is random", ge=0)

    people: int = _option(2, "how many walk about the room", ge=0, le=20)
    moving: bool = _option(False, "the sensor moves along a path")
    sigma_range: float = _option(0.01, "noise of the ranges, m", gt=0, le=1)
    sigma_bearing: float = _option(0.001, "noise of the bearings, rad", gt=0, le=0.05)
    range_growth: float = _option(
        0.0003, "times the square of a range: what its noise grows by, 1/m", ge=0, le=0.1
    )
    unevenness: float = _option(0.004, "standard deviation of the walls from straight lines, m", ge=0, le=0.1)
    unevenness_length: float = _option(
        0.08, "distance along a wall over which that is alike, m", ge=0.005, le=2
    )
    mixed: float = _share(0.5, "share of the beams at an edge that report a range between")
    dropouts: float = _share(0.003, "share of the beams without return for no reason")

    rpm: int = _option(600, "speed until another one is asked for", **_RPM)
    min_rpm: int = _option(480, "lowest speed", **_RPM)
    max_rpm: int = _option(900, "highest speed", **_RPM)
    jitter: float = _share(0.002, "standard deviation of the speed, as a share of it")
    spin_up: float = _option(0.5, "time from rest to a stable speed, s", **_SECONDS)
    reset: float = _option(2.0, "time for which nothing is answered after RESET, s", **_SECONDS)
    boot: float = _option(0.0, "time for which nothing is answered once plugged in, s", **_SECONDS)

    baud: int = _option(256_000, "the sensor's; another one gives garbage", ge=1200, le=4_000_000)
    health: int = _option(0, "0 good, 1 warning, 2 protection stop", ge=0, le=2)
    health_code: int = _option(0, "code beside the health", ge=0, le=65535)
    health_sticks: bool = _option(False, "RESET does not mend the health")
    streaming: bool = _option(False, "scanning already, as after a client that crashed")
    legacy_only: bool = _option(False, "knows SCAN only: no express scan, no configuration")
    silent_conf: bool = _option(False, "leaves every question about configuration unanswered")

    flip: float = _share(0.0, "share of the packets with a bit flipped")
    lose: float = _share(0.0, "share of the packets that are lost")
    lose_bytes: float = _share(0.0, "share of the bytes that are lost")

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
