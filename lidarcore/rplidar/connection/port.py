"""The sensor's serial port: opened for this program alone, read and written with bounded waits, its errors named."""

import errno
import glob
import os
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Literal

from serial import Serial, SerialTimeoutException
from serial.tools.list_ports import comports
from serial.tools.list_ports_common import ListPortInfo

from lidarcore.errors import (
    DeviceError,
    NoAnswerError,
    NoDeviceError,
    PortBusyError,
    PortPermissionError,
    UnpluggedError,
)

try:
    from termios import error as TerminalError  # noqa: N812  no OSError, and pyserial lets it through
except ImportError:  # Windows
    TerminalError = OSError  # type: ignore[misc,assignment]

ListPorts = Callable[[], Iterable[ListPortInfo]]
Tap = Callable[[Literal["in", "out"], float, bytes], object]

QUIET = 0.05  # s without a byte after which a port counts as drained, and the longest read
WRITE_TIMEOUT = 1.0  # s
TERMINALS = ("/dev/tty", "/dev/pts/", "/dev/rfcomm")


class Cancelled(Exception):  # noqa: N818  no error: somebody closed the driver
    """The port was being read when the driver was closed."""


class Port:
    """An open serial port; `tap` sees every byte, with "in" or "out" and Unix seconds.

    Raises NoDeviceError, PortPermissionError, PortBusyError or DeviceError when it cannot be opened, UnpluggedError
    when it goes away later, NoAnswerError when it takes no bytes, and from read() also Cancelled once `cancelled` is
    set, and what the tap raised.
    """

    def __init__(
        self, path: str, baud: int, tap: Tap | None = None, cancelled: threading.Event | None = None
    ) -> None:
        self.path = path = path_of(path)
        self.baud = baud
        self._tap = tap
        self._tap_failure: Exception | None = None
        self._writing = threading.Lock()  # with close(): a number of a closed file may soon be another's
        self.cancelled = cancelled or threading.Event()
        # Before opening, which already disturbs: not everybody locks what he uses (Slamtec's SDK does not).
        if programs := holders(path):
            raise _busy(path, programs)
        try:
            self._serial = Serial(path, baud, timeout=QUIET, write_timeout=WRITE_TIMEOUT, exclusive=True)
        except (OSError, ValueError, TerminalError) as error:
            raise _opening_error(path, baud, error) from error

    def read(self) -> bytes:
        """Whatever has arrived, as soon as something has; nothing if it stayed quiet for QUIET seconds."""
        if self.cancelled.is_set():
            raise Cancelled
        if self._tap_failure:
            raise self._tap_failure
        try:
            data: bytes = self._serial.read(1)
            if data:
                data += self._serial.read(self._serial.in_waiting)
        except (OSError, TerminalError) as error:
            raise self._unplugged() from error
        if data:
            self._tell("in", data)
        return data

    def write(self, data: bytes) -> None:
        """Send the bytes."""
        try:
            with self._writing:
                self._serial.write(data)
        except SerialTimeoutException as error:
            raise NoAnswerError(
                f"{self.path} accepts no bytes: unplug the sensor and plug it in again."
            ) from error
        except (OSError, TerminalError) as error:
            raise self._unplugged() from error
        self._tell("out", data)

    def drain(self, limit: float = 0.5) -> bool:
        """Read and forget until it is quiet; False if it still talks after `limit` seconds."""
        end = time.monotonic() + limit
        while self.read():
            if time.monotonic() > end:
                return False
        return True

    def set_baud(self, baud: int) -> None:
        """Go on at another baud rate."""
        try:
            self._serial.baudrate = baud
        except (OSError, ValueError, TerminalError) as error:
            raise _opening_error(self.path, baud, error) from error
        self.baud = baud

    def close(self) -> None:
        """Let go of the port, also of a dead one."""
        with self._writing:
            self._serial.close()
        self._tap = None

    def _tell(self, direction: Literal["in", "out"], data: bytes) -> None:
        """What the tap raises is kept for the next read(): it must not prevent the motor from being stopped."""
        if tap := self._tap:
            try:
                tap(direction, time.time(), data)
            except Exception as error:
                self._tap, self._tap_failure = None, error

    def _unplugged(self) -> UnpluggedError:
        return UnpluggedError(f"{self.path} went away: check the sensor's cable and plug it in again.")


def path_of(port: str) -> str:
    """Path of a port that may be given by its mere name, such as ttyUSB0. Raises NoDeviceError for no text."""
    try:
        port.encode()
    except UnicodeEncodeError:
        is_text = False
    else:
        is_text = "\0" not in port
    if not is_text:
        raise NoDeviceError(f"{port!a} cannot be the path of a port: {ports_there_are()}")
    is_name = os.name == "posix" and "/" not in port and not os.path.lexists(port)
    return f"/dev/{port}" if is_name else port


def holders(path: str) -> list[str]:
    """Other programs that have the port open, as "name (pid 123)", as far as the system lets this user see."""
    try:
        device = os.path.realpath(path)
    except OSError:  # it was a link, and is gone
        return []
    if not (device.startswith(TERMINALS) and os.path.exists(device)):
        return []
    return [_program(process) for process in glob.glob("/proc/[0-9]*") if _holds(process, device)]


def _holds(process: str, device: str) -> bool:
    if process == f"/proc/{os.getpid()}":
        return False
    try:
        files = {os.readlink(f"{process}/fd/{number}") for number in os.listdir(f"{process}/fd")}
    except OSError:  # another user's, or gone
        return False
    # Who holds the other end of a pseudo-terminal is the sensor, not a rival.
    return device in files and files.isdisjoint({"/dev/ptmx", "/dev/pts/ptmx"})


def _program(process: str) -> str:
    try:
        name = Path(process, "comm").read_text("utf-8").strip()
    except OSError:
        name = "a program"
    return f"{name} (pid {os.path.basename(process)})"


def _opening_error(path: str, baud: int, error: Exception) -> DeviceError:
    # What the system says to an unusual baud rate, pyserial raises as ValueError, also of a port that went away.
    reason = error.__context__ if isinstance(error, ValueError) else error
    match getattr(reason, "errno", None):
        case errno.ENOENT | errno.ENODEV | errno.ENXIO:
            return NoDeviceError(f"There is no port {path}: {ports_there_are()}")
        case errno.EACCES | errno.EPERM:
            return PortPermissionError(f"You may not open {path}: {_remedy(path)}.")
        case errno.EBUSY | errno.EAGAIN:
            return _busy(path, holders(path))
        case number if isinstance(error, ValueError) and number != errno.EIO:
            return DeviceError(f"{path} cannot be set to {baud} baud: the RPLIDAR S1 talks at 256000.")
        case number:
            why = f" ({os.strerror(number)})" if number else ""
            return NoDeviceError(f"{path} cannot be used as a serial port{why}: {ports_there_are()}")


def ports_there_are(list_ports: ListPorts = comports) -> str:
    """What serial ports this machine has, as the end of a sentence."""
    paths = sorted(port.device for port in list_ports())
    if not paths:
        return "this machine has no serial port."
    return f"the serial ports of this machine are {', '.join(paths)}."


def _busy(path: str, programs: list[str]) -> PortBusyError:
    return PortBusyError(
        f"{path} is in use by {' and '.join(programs) or 'another program'}: end that first."
    )


def _remedy(path: str) -> str:
    try:
        group = Path(path).group()
    except (OSError, KeyError, NotImplementedError):
        group = "dialout"
    if group == "root":
        return f"run `sudo chmod a+rw {path}`"
    return f"run `sudo usermod -aG {group} $USER`, then log out and in again"
