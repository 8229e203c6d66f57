"""A pseudo-terminal that looks like a serial port, at a path that stays the same when it is plugged in again."""

import errno
import os
import struct
import sys
from pathlib import Path

from lidarcore.errors import DeviceError
from lidarcore.files import reason

_TCGETS2 = 0x802C542A  # Linux: the speed as a number, also where it is none of the standard ones
_TERMIOS2 = struct.Struct("4I20x2I")
_BUFFER = 4096


class PseudoTerminal:
    """One end of a serial line; programs open the other one through the symbolic link.

    Raises DeviceError if the system has no pseudo-terminals, or if the link cannot be made.
    """

    def __init__(self, link: Path) -> None:
        self.link = link
        self._ends: tuple[int, int] | None = None
        self.plug()

    @property
    def plugged(self) -> bool:
        """There is a port."""
        return self._ends is not None

    def fileno(self) -> int:
        """Readable when a program has written. Raises DeviceError while unplugged."""
        return self._open[0]

    @property
    def baud(self) -> int | None:
        """The speed set by who has it open, None where the system does not tell."""
        if sys.platform != "linux":
            return None
        import fcntl

        try:
            answer = fcntl.ioctl(self._open[1], _TCGETS2, bytes(_TERMIOS2.size))
        except OSError:  # the number of this question differs on a few processors
            return None
        return int(_TERMIOS2.unpack(answer)[-1])

    def plug(self) -> None:
        """Make the port appear."""
        try:
            import tty

            ends = os.openpty()
            # Our end of the other side stays open: without it, nobody there would be an error.
            tty.setraw(ends[1])
        except (ImportError, OSError) as error:
            raise DeviceError(
                f"This system offers no pseudo-terminal for the emulator: {reason(error)}."
            ) from error
        os.set_blocking(ends[0], False)
        self._ends = ends
        try:
            self._link(Path(os.ttyname(ends[1])))
        except OSError as error:
            self.unplug()
            raise DeviceError(
                f"{self.link} cannot be made a link: {error.strerror}. Give another path."
            ) from error

    def unplug(self) -> None:
        """Make the port go away, as pulling the plug does: who has it open gets errors."""
        if self._ends is None:
            return
        for end in self._ends:
            os.close(end)
        self._ends = None
        if self.link.is_symlink():
            self.link.unlink()

    def read(self) -> bytes:
        """What was written to the port so far."""
        try:
            return os.read(self.fileno(), _BUFFER)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> None:
        """Send; what a program that does not read leaves no room for is lost, as on a real line."""
        try:
            os.write(self.fileno(), data)
        except BlockingIOError:
            return

    @property
    def _open(self) -> tuple[int, int]:
        if self._ends is None:
            raise DeviceError("The port is unplugged.")
        return self._ends

    def _link(self, target: Path) -> None:
        """Point the link there, in one step; a file that is no link is left alone."""
        if self.link.exists() and not self.link.is_symlink():
            raise FileExistsError(errno.EEXIST, "something else is there")
        new = self.link.with_name(f".{self.link.name}.{os.getpid()}")
        new.symlink_to(target)
        new.replace(self.link)
