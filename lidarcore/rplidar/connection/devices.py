"""Which serial ports there are, and which of them an RPLIDAR is connected to."""

import threading
from contextlib import closing
from dataclasses import dataclass, replace

from serial.tools.list_ports import comports
from serial.tools.list_ports_common import ListPortInfo

from lidarcore.errors import DeviceError, NoAnswerError, NoDeviceError, PortBusyError
from lidarcore.rplidar.answers import DeviceInfo
from lidarcore.rplidar.connection.handshake import COMMON_BAUDS, find_baud, identify, stop
from lidarcore.rplidar.connection.port import ListPorts, Port, ports_there_are

ADAPTERS = {(0x10C4, 0xEA60)}  # CP2102, on the USB adapter of every RPLIDAR


@dataclass(frozen=True)
class FoundDevice:
    """A serial port.

    vid_pid     of the USB adapter, such as "10c4:ea60"; None if it is not on USB
    looks_like  its adapter is of the kind that RPLIDARs have; only these are asked
    info        what the sensor said; None if it was not asked or did not answer
    baud        rate at which it answered
    error       why there is no answer
    in_use      another program, or another part of this one, has it
    """

    path: str
    description: str
    vid_pid: str | None
    looks_like: bool
    info: DeviceInfo | None = None
    baud: int | None = None
    error: str | None = None
    in_use: bool = False


def find_devices(ask: bool = True, list_ports: ListPorts = comports) -> list[FoundDevice]:
    """The serial ports of this machine, sorted by path.

    ask  also ask every port that looks like an RPLIDAR what is there, which stops a sensor that was left
         turning; a port that some program has open is left alone. A silent one takes about two seconds.
    """
    found = [_describe(port) for port in sorted(list_ports(), key=lambda port: str(port.device))]
    return [_ask(device) if ask and device.looks_like else device for device in found]


def only_device(list_ports: ListPorts = comports) -> str:
    """Path of the one RPLIDAR connected; if several ports look like it, they are asked. Raises NoDeviceError."""
    devices = [device for device in find_devices(ask=False, list_ports=list_ports) if device.looks_like]
    if len(devices) > 1:
        asked = [_ask(device) for device in devices]
        devices = [device for device in asked if device.info]
        if not devices:
            raise NoDeviceError(" ".join(f"{device.path}: {device.error}" for device in asked))
    if len(devices) > 1:
        paths = ", ".join(device.path for device in devices)
        raise NoDeviceError(f"Several RPLIDARs are connected: choose one of the ports {paths}.")
    if not devices:
        raise NoDeviceError(
            f"No RPLIDAR is connected: plug one in, or name its port; {ports_there_are(list_ports)}"
        )
    return devices[0].path


def find_other_baud(path: str, baud: int, cancelled: threading.Event) -> int | None:
    """Another common baud rate than this at which an RPLIDAR answers there. Raises DeviceError and Cancelled."""
    with closing(Port(path, baud, cancelled=cancelled)) as port:
        found = find_baud(port)
        return found[0] if found else None


def _describe(port: ListPortInfo) -> FoundDevice:
    if port.vid is None:
        return FoundDevice(port.device, port.description or port.device, None, looks_like=False)
    looks_like = (port.vid, port.pid) in ADAPTERS
    return FoundDevice(port.device, port.description, f"{port.vid:04x}:{port.pid:04x}", looks_like)


def _ask(device: FoundDevice) -> FoundDevice:
    try:
        baud, info = _who_is_at(device.path)
    except DeviceError as error:
        return replace(device, error=str(error), in_use=isinstance(error, PortBusyError))
    return replace(device, baud=baud, info=info)


def _who_is_at(path: str) -> tuple[int, DeviceInfo]:
    """Baud rate at which an RPLIDAR answers there, and which it is; it is stopped. Raises DeviceError."""
    with closing(Port(path, COMMON_BAUDS[0])) as port:
        found: tuple[int, DeviceInfo] | None
        try:
            found = port.baud, identify(port, tries=2)
        except NoAnswerError:
            if (found := find_baud(port)) is None:
                raise
        stop(port)
        return found
