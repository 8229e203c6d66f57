"""Watching a driver from outside, and programs that use one."""

import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

from serial import Serial
from waiting import PATIENCE as PATIENCE

from lidarcore.rplidar import Driver, State
from lidarcore.rplidar.protocol import Command, request

MOTOR_STOPS = bytes.fromhex("a525 a5a80200000f")  # STOP, and speed 0, as the protocol has them


class Watched(Driver):
    """A driver whose states are remembered with their times (s, monotonic) and can be waited for."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self.states: list[tuple[float, State]] = []
        self._changed = threading.Condition()
        super().__init__(*arguments, on_change=self._remember, **options)

    def _remember(self) -> None:
        with self._changed:
            self.states.append((time.monotonic(), self.state))
            self._changed.notify_all()

    def wait_for(self, state: State, since: float = 0.0, within: float = PATIENCE) -> float:
        """When it came into that state, not before `since`. Fails if it does not."""
        with self._changed:
            reached = self._changed.wait_for(lambda: self._when(state, since), within)
        assert reached, f"not {state} within {within} s, but {self.states} ({self.error})"
        return reached

    def _when(self, state: State, since: float) -> float | None:
        return next((time for time, name in self.states if name == state and time >= since), None)


class Program(subprocess.Popen[str]):
    """A program of its own that runs a driver; everything it sends to the sensor is in the file `sent`."""

    START = """
import sys, itertools
from lidarcore.rplidar import Driver
sent = open(sys.argv[2], "wb", buffering=0)
def tap(direction, when, data):
    if direction == "out":
        sent.write(data)
driver = Driver(sys.argv[1], tap=tap)
"""

    def __init__(self, port: str, sent: Path, body: str) -> None:
        self._sent = sent
        command = [sys.executable, "-c", self.START + body, port, str(sent)]
        super().__init__(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def await_line(self) -> None:
        """Wait until it has printed something."""
        assert self.stdout is not None
        line = self.stdout.readline()
        assert line, self.communicate()[1]

    def stopped_the_motor(self) -> bool:
        """The last it sent was what stops the motor."""
        return self._sent.read_bytes().endswith(MOTOR_STOPS)


def leave_streaming(port: str, size: int = 200) -> None:
    """Start a scan and go away without stopping it, as a program that is killed; `size` bytes of it are read."""
    with Serial(port, 256_000, timeout=PATIENCE) as line:
        line.write(request(Command.EXPRESS_SCAN, bytes((1, 0, 0, 0, 0))))
        assert len(line.read(size)) == size
