"""A long command in a process of its own: `lidarcore` at low priority, which ends with this one however that ends."""

import os
import re
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

ROOT = Path(__file__).parents[2]  # nothing that lies in the current folder is imported by the command
NICE = 10  # live view comes first
PROGRESS = "progress"  # what a line of it begins with: progress DONE TOTAL
KEPT = 40  # lines of what it says, for the message of a failure
END_WITHIN = 20.0  # s that its processes may take to go once they are killed


class CommandProcess:
    """Runs `lidarcore` with these arguments; `ended` is told, from a thread of its own, its exit code and message."""

    def __init__(self, arguments: Sequence[str], ended: Callable[[int, str], None]) -> None:
        self.done = self.total = 0
        self._output: deque[str] = deque(maxlen=KEPT)
        self._ended = ended
        # Its input is held open by this process alone, and it ends with that: also after a kill -9 of this one.
        # A session of its own: what a terminal interrupts is this process, which then ends the command.
        self._process = subprocess.Popen(
            [sys.executable, "-m", "lidarcore_app.cli.main", *arguments, "--progress"],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            errors="replace",
            start_new_session=True,
        )
        with suppress(OSError):  # gone already
            os.setpriority(os.PRIO_PROCESS, self._process.pid, NICE)
        self._reader = threading.Thread(target=self._read, name="command", daemon=True)
        self._reader.start()

    def kill(self) -> None:
        """End it now; its workers end with it. `ended` has been told when this returns."""
        self._process.kill()
        if self._reader is not threading.current_thread():
            from lidarcore import (
                threads,  # here: the command line, which needs PROGRESS, answers at once without it
            )

            threads.join(self._reader, END_WITHIN)

    def _read(self) -> None:
        """What it says, until the last of its processes has gone."""
        assert self._process.stderr is not None
        assert self._process.stdin is not None
        for line in self._process.stderr:
            if (parts := parts_done(line)) is not None:
                self.done, self.total = parts
            elif line.strip():
                self._output.append(line.strip())
        code = self._process.wait()
        self._process.stderr.close()
        self._process.stdin.close()
        self._ended(code, self._message(code))

    def _message(self, code: int) -> str:
        """The sentence the command ends with, which is the last line of a traceback, too."""
        if self._output:
            return self._output[-1].removeprefix("lidarcore: ")
        return (
            f"The process was killed by signal {-code}."
            if code < 0
            else f"The process ended with code {code}."
        )


def parts_done(line: str) -> tuple[int, int] | None:
    """How many parts are done, of how many, if the line says so."""
    found = re.match(rf"\s*{PROGRESS}\s+(\d+)\s+(\d+)(?!\S)", line)
    return (int(found[1]), int(found[2])) if found else None
