"""The command `lidarcore devices`."""

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from lidarcore.rplidar import FoundDevice

ADVICE = """\
No RPLIDAR found. Plug it in, wait a second and try again; see that it has power and that its cable carries data.
One at another kind of adapter, or at a UART, is used by naming its port: lidarcore serve --port PATH.
Without a sensor, lidarcore serve takes an emulated one."""


def devices(
    ask: Annotated[
        bool,
        typer.Option(
            help="query every port that looks like an RPLIDAR; this stops one that was left turning"
        ),
    ] = True,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON, for programs")] = False,
) -> None:
    """List the serial ports, and say which are RPLIDARs."""
    from lidarcore.rplidar import find_devices

    found = find_devices(ask)
    if as_json:
        typer.echo(json.dumps([asdict(device) for device in found], indent=2))
        return
    if found:
        _print(found)
    if not any(device.looks_like for device in found):
        typer.echo(ADVICE)


def _print(found: "list[FoundDevice]") -> None:
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Column, Table

    table = Table(Column("Port", no_wrap=True), "Adapter", "USB id", "Sensor", box=SIMPLE)
    for device in found:
        table.add_row(device.path, device.description, device.vid_pid or "-", sensor_at(device))
    Console(highlight=False, markup=False).print(table)


def sensor_at(device: "FoundDevice") -> str:
    """What is at the port, in words."""
    if device.info:
        info = device.info
        return f"{info.name}, firmware {info.version}, serial {info.serial}, {device.baud} baud"
    if device.error:
        return device.error
    return "looks like an RPLIDAR" if device.looks_like else "no RPLIDAR, by its adapter"
