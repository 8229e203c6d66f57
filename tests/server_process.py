"""A server in a process of its own, for programs that watch it from outside."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil

END_WITHIN = 30  # s


@contextmanager
def server(folder: Path, *options: str) -> Iterator[tuple[psutil.Process, str]]:
    """`lidarcore serve` with these options, and its address; what it keeps and logs goes into the folder."""
    command = [sys.executable, "-m", "lidarcore_app.cli.main", "serve", "--http-port", "0", *options]
    command += ["--recordings", str(folder / "recordings")]
    with (folder / "log").open("w") as log:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
        assert process.stdout is not None
        try:
            address = next(line.split()[-1] for line in process.stdout if "http://" in line)
            yield psutil.Process(process.pid), address.rstrip("/")
        finally:
            process.terminate()
            process.wait(END_WITHIN)
