"""`lidarcore` as people run it, in processes of its own."""

import os
import re
import signal
import subprocess
import sys
from typing import Any

from serving import ROOT

ENVIRONMENT = {name: value for name, value in os.environ.items() if not name.startswith("LIDARCORE")}


def run(*arguments: object, timeout: float = 120) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lidarcore_app.cli.main", *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True, timeout=timeout)


def assert_refused(result: subprocess.CompletedProcess[str], *words: str) -> None:
    """Exit code 2 and one sentence that has these words."""
    assert result.returncode == 2, result
    assert result.stdout == ""
    assert result.stderr.startswith("lidarcore: ")
    assert len(result.stderr.strip().splitlines()) == 1
    for word in words:
        assert word in result.stderr


class Serving:
    """`lidarcore serve` in a process of its own; `said` is what it printed before its address."""

    def __init__(self, *arguments: object, **options: Any) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "lidarcore_app.cli.main", "serve", *map(str, arguments)],
            cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            **{"env": ENVIRONMENT} | options,
        )  # fmt: skip
        self.said = ""
        for line in self.process.stdout:
            if match := re.search(r"http://\S+", line):
                self.url = match[0]
                return
            self.said += line
        raise AssertionError(self.process.communicate())

    def end(self, number: int = signal.SIGINT) -> str:
        """Press Ctrl-C, or send another signal; what it says about it. It has a minute to end, however busy it is."""
        self.process.send_signal(number)
        return self.process.communicate(timeout=60)[1]
