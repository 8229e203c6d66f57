"""What a file may cost: four times its size in memory, and what the interpreter takes."""

import re
from pathlib import Path

import pytest
from large_files import MEBIBYTE, make

from lidarcore import LidarError
from lidarcore.recordings import open_recording

SIZE, SLACK = 2 * MEBIBYTE, 20 * MEBIBYTE  # of the interpreter, and of pieces of a MiB while they are parsed


@pytest.mark.parametrize(
    "name",
    ["points.json", "nested.json", "hex.txt", "carmen_parameters.log", "connections.bag"],
)
def test_a_file_of_many_small_things_takes_little_memory(tmp_path: Path, name: str) -> None:
    path = make(tmp_path, name, SIZE)
    Path("/proc/self/clear_refs").write_text("5")
    before = peak_memory()
    try:
        for _ in open_recording(path):
            pass
    except LidarError:
        pass
    assert peak_memory() - before < 4 * path.stat().st_size + SLACK


def peak_memory() -> int:
    """Largest resident memory of this process in bytes (proc(5): clear_refs, VmHWM)."""
    return 1024 * int(re.search(r"VmHWM:\s+(\d+)", Path("/proc/self/status").read_text())[1])
