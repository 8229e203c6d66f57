"""The emulator as a process of its own, which ends with this one."""

import queue
import subprocess
import sys
import threading
from contextlib import suppress
from typing import Any, Self

from lidarcore.errors import DeviceError
from lidarcore.rplidar.emulation.options import FIRST_LINE, EmulatorOptions

_MODULE = "lidarcore.rplidar.emulator"
_START_TIME = 60.0  # s; under one, unless kernels have to be compiled
_ANSWER_TIME = 10.0  # s
_QUIT_TIME = 5.0  # s


class EmulatorProcess:
    """An emulated S1 at `port`, with the options of EmulatorOptions; a context manager.

    Raises DeviceError if it does not come up, and pydantic's ValidationError for options that cannot be.
    """

    def __init__(self, **options: Any) -> None:
        arguments = EmulatorOptions(**options).arguments()
        # A session of its own: what a terminal interrupts is this process, which then ends the emulator.
        self._process = subprocess.Popen(
            [sys.executable, "-m", _MODULE, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self._speaking = threading.Lock()  # each question gets its own answer
        self._lines: queue.Queue[str] = queue.Queue()
        self._reader = threading.Thread(target=self._read, name="emulator", daemon=True)
        self._reader.start()
        self.port = self._first_line().removeprefix(FIRST_LINE)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def pid(self) -> int:
        """Of the process."""
        return self._process.pid

    def command(self, line: str) -> None:
        """Have it obey, such as "unplug" or "lose 0.05". Raises DeviceError if it does not."""
        assert self._process.stdin is not None
        with self._speaking:
            try:
                self._process.stdin.write(line + "\n")
                self._process.stdin.flush()
            except (OSError, ValueError):  # gone, or closed
                raise DeviceError(f"The emulator is not running any more, it cannot {line}.") from None
            answer = self._next_line(_ANSWER_TIME)
        if not answer.startswith("ok"):
            raise DeviceError(f"The emulator cannot {line}: {answer.removeprefix('error: ')}.")

    def close(self) -> None:
        """End it; if it has ended already, this does nothing."""
        assert self._process.stdin is not None
        with suppress(OSError):
            self._process.stdin.close()  # it quits at the end of its input
        try:
            self._process.wait(_QUIT_TIME)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
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

    def _read(self) -> None:
        """Lines as they come, and an empty one at the end."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put("")
