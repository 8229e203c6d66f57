"""The emulator as a process of its own, which ends with this one."""

import queue
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from lidarcore.closing import Closing
from lidarcore.errors import DeviceError
from lidarcore.rplidar.emulation.options import FIRST_LINE, EmulatorOptions

_MODULE = "lidarcore.rplidar.emulator"
_START_TIME = 60.0  # s; under one, unless kernels have to be compiled
_ANSWER_TIME = 10.0  # s
_QUIT_TIME = 5.0  # s


class EmulatorProcess(Closing):
    """An emulated S1 at `port`, with the options of EmulatorOptions; a context manager.

    noise   what its measurements err by
    on_end  called, from a thread of its own, when the process ends without `close`; its port is gone by then

    Raises DeviceError if it does not come up, and pydantic's ValidationError for options that cannot be.
    """

    def __init__(self, *, on_end: Callable[[], None] | None = None, **options: Any) -> None:
        chosen = EmulatorOptions(**options)
        self.noise = chosen.noise
        self._owns_folder = chosen.link is None
        self._closing = threading.Event()
        # A session of its own: what a terminal interrupts is this process, which then ends the emulator.
        self._process = subprocess.Popen(
            [sys.executable, "-m", _MODULE, *chosen.arguments()],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self._speaking = threading.Lock()  # each question gets its own answer
        self._lines: queue.Queue[str] = queue.Queue()
        self._reader = threading.Thread(target=self._read, args=(on_end,), name="emulator", daemon=True)
        self._reader.start()
        self.port = self._first_line().removeprefix(FIRST_LINE)

    @property
    def pid(self) -> int:
        """Id of the process."""
        return self._process.pid

    def command(self, line: str) -> None:
        """Have it obey, such as "unplug" or "lose 0.05". Raises DeviceError if it does not."""
        assert self._process.stdin is not None
        with self._speaking:
            try:
                self._process.stdin.write(line + "\n")
                self._process.stdin.flush()
            except (OSError, ValueError):  # gone, or closed
                raise DeviceError(f"The emulator is no longer running, and so cannot {line}.") from None
            answer = self._next_line(_ANSWER_TIME)
        if not answer.startswith("ok"):
            raise DeviceError(f"The emulator cannot {line}: {answer.removeprefix('error: ')}.")

    def close(self) -> None:
        """End it; if it has ended already, this does nothing."""
        assert self._process.stdin is not None
        self._closing.set()
        with suppress(OSError):
            self._process.stdin.close()  # it quits at the end of its input
        try:
            self._process.wait(_QUIT_TIME)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._reader is threading.current_thread():  # in `on_end`: nothing is read any more
            return
        self._reader.join()
        for output in (self._process.stdout, self._process.stderr):
            assert output is not None
            output.close()

    def _first_line(self) -> str:
        try:
            line = self._next_line(_START_TIME)
            if not line.startswith(FIRST_LINE):
                raise DeviceError(f"The emulator said {line!r} instead of its port.")
            return line
        except DeviceError:
            self.close()
            raise

    def _next_line(self, patience: float) -> str:
        try:
            line = self._lines.get(timeout=patience)
        except queue.Empty:
            raise DeviceError(f"The emulator said nothing for {patience:g} s.") from None
        if not line:
            assert self._process.stderr is not None
            raise DeviceError(
                f"The emulator has ended: {self._process.stderr.read().strip() or 'it was told to'}"
            )
        return line.rstrip("\n")

    def _read(self, on_end: Callable[[], None] | None) -> None:
        """Lines as they come, and an empty one at the end; then see to what the process has left behind."""
        assert self._process.stdout is not None
        first = self._process.stdout.readline()
        self._lines.put(first)
        for line in self._process.stdout:
            self._lines.put(line)
        killed = self._process.wait() != 0  # else it has cleared up itself
        if killed and first.startswith(FIRST_LINE):
            self._clear_up(Path(first.removeprefix(FIRST_LINE).rstrip("\n")))
        self._lines.put("")
        if first and on_end and not self._closing.is_set():
            on_end()

    def _clear_up(self, link: Path) -> None:
        """Remove the port, which may soon lead to another's terminal."""
        with suppress(OSError):
            link.unlink()
        if self._owns_folder:
            with suppress(OSError):
                link.parent.rmdir()
