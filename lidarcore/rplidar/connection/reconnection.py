"""Reconnecting to a sensor that was unplugged, at the same port or at another one."""

from collections.abc import Callable
from contextlib import closing, suppress

from lidarcore.errors import DeviceError, NoDeviceError
from lidarcore.rplidar.connection.devices import find_devices
from lidarcore.rplidar.connection.handshake import identify
from lidarcore.rplidar.connection.port import Cancelled, ListPorts, Port
from lidarcore.rplidar.connection.session import Session

FIRST_PAUSE = 0.1  # s between two attempts, doubled from one to the next
LONGEST_PAUSE = 5.0  # s
LONGEST_PAUSE_ABSENT = 0.4  # s; to look whether there is a port costs nothing and disturbs nobody


def find_again(
    lost: Session,
    connect: Callable[[str], Session],
    list_ports: ListPorts,
    complain: Callable[[DeviceError], None],
) -> Session:
    """Try until it is back: whatever sensor is at the same path, or the same one at another path.

    What hinders it at a port that is there is told to `complain`. Raises Cancelled once the driver is closed.
    """
    pause, before, strangers = FIRST_PAUSE, DeviceError, set[str]()
    while not lost.port.cancelled.wait(pause):
        try:
            return _find(lost, connect, list_ports, strangers)
        except DeviceError as error:
            if not isinstance(error, NoDeviceError):  # that it went away has been said
                complain(error)
            longest = LONGEST_PAUSE_ABSENT if isinstance(error, NoDeviceError) else LONGEST_PAUSE
            # Something else than before is the matter: it may be just coming up.
            pause = min(2 * pause, longest) if type(error) is before else FIRST_PAUSE
            before = type(error)
    raise Cancelled


def _find(
    lost: Session, connect: Callable[[str], Session], list_ports: ListPorts, strangers: set[str]
) -> Session:
    try:
        return connect(lost.port.path)
    except DeviceError:
        candidates = {
            device.path for device in find_devices(ask=False, list_ports=list_ports) if device.looks_like
        }
        strangers &= candidates  # a port that went away may come back with another sensor
        for path in sorted(candidates - strangers - {lost.port.path}):
            serial = _serial(path, lost)
            if serial == lost.info.serial:
                return connect(path)
            if serial is not None:
                strangers.add(path)  # not to be disturbed again
        raise


def _serial(path: str, lost: Session) -> str | None:
    """Serial number of the sensor at that path, None if none answers."""
    with suppress(DeviceError), closing(Port(path, lost.port.baud, cancelled=lost.port.cancelled)) as port:
        return identify(port, tries=2).serial
    return None
