"""The sensors there are, and the faults of the emulated one."""

from typing import Annotated

from fastapi import APIRouter, Body
from pydantic import Field
from typing_extensions import TypedDict

from lidarcore.body_mask import Sector
from lidarcore.rplidar import FoundDevice, find_devices

from ...errors import ConflictError
from ...records import record
from ...sources.live import LiveSource
from ..dependencies import Server
from ..problems import documented
from ..schemas import StrictBody

router = APIRouter(tags=["sensor"])


class FoundDeviceJson(TypedDict):
    """A serial port, and what is known of what is there."""

    path: str
    description: str
    vid_pid: str | None
    looks_like: bool
    name: str | None
    serial: str | None
    error: str | None
    in_use: bool


class SuggestionJson(TypedDict):
    """A mask as the settings take it; empty if nothing but the room is seen."""

    mask: tuple[Sector, ...]


class Fault(StrictBody):
    """What the emulated sensor is to do."""

    command: Annotated[
        str,
        Field(
            max_length=100,
            pattern=r"^(unplug|replug|(stall|flip|lose|lose-bytes|garbage|health)( [0-9.]+){1,2})$",
            description="unplug, replug, stall SECONDS, flip SHARE, lose SHARE, lose-bytes SHARE, garbage BYTES or "
            "health STATUS [CODE]",
        ),
    ]


@router.get("/devices", response_description="The serial ports")
def devices() -> list[FoundDeviceJson]:
    """The serial ports of this machine; those that look like an RPLIDAR are asked, which stops one left turning."""
    return [_found(device) for device in find_devices()]


@router.get(
    "/sensor/mask/suggestion",
    response_description="Sectors for the setting `sensor.mask`",
    responses=documented(409),
)
def suggest(server: Server) -> SuggestionJson:
    """Where the robot's own body is: near, and in its place while everything else moves. Nothing is changed.

    Asked of the last 20 s of a sensor, or of 200 scans of a recording as they were measured, without the present mask.
    409 if there are too few of them, or the sensor did not move enough to tell body and room apart.
    """
    return {"mask": server.runtime.suggested_mask()}


@router.post("/emulator", status_code=204, responses=documented(409, 422))
def obey(server: Server, fault: Annotated[Fault, Body(examples=[{"command": "lose 0.05"}])]) -> None:
    """Have the emulated sensor show a fault, to see what becomes of it."""
    source = server.runtime.player.source
    if not isinstance(source, LiveSource) or source.emulator is None:
        raise ConflictError('No emulator is playing: PUT {"kind": "emulator"} to /api/v1/source first.')
    source.emulator.command(fault.command)


def _found(device: FoundDevice) -> FoundDeviceJson:
    name, serial = (device.info.name, device.info.serial) if device.info else (None, None)
    return record(FoundDeviceJson, device, name=name, serial=serial)
