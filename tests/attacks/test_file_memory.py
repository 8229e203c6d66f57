"""What a file may cost beside what the process takes that reads it: four times its size, and 100 MB."""

import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import pytest
from large_files import MEBIBYTE, NAMES, make
from lidarcore_app.isolation import Isolated
from lidarcore_app.jobs import map_file

from lidarcore import LidarError, RecordingError
from lidarcore.mapping.grid import read_ros_map
from lidarcore.recordings import open_recording

# MiB: as much as it takes to see what grows with the file.
USUAL, SIZES = 0.5, {
    "carmen_odometry.log": 16, "many_sets.json": 20, "lego_reference.txt": 8, "lego_encoders.txt": 8, "chunks.mcap": 8,
    "map.json": 8, "map.geojson": 8, "map_nested.json": 8, "map.png": 8, "map.pgm": 8, "map.bmp": 8, "samples.csv": 4,
    "dump.txt": 4, "packed.npz": 8, "points.json": 4, "nested.json": 2, "hex.txt": 2, "connections.bag": 2,
    "carmen_parameters.log": 2,
}  # fmt: skip
# Beside what grows with it a file may take 100 MB; most take much less: pieces of a MiB while they are parsed.
FEW = 25_000_000
MANY = ("lego_reference.txt", "lego_encoders.txt", "chunks.mcap", "map_nested.json", "map.png", "map.bmp", "map.pgm",
    "samples.csv", "dump.txt", "packed.npz")  # fmt: skip
ENOUGH = 5000  # scans of a recording: opening has gone through all of it before the first
YAML = "resolution: 1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\nimage: "


@pytest.mark.parametrize("name", NAMES)
def test_a_file_of_many_small_things_takes_little_memory(tmp_path: Path, name: str) -> None:
    path = make(tmp_path, name, int(SIZES.get(name, USUAL) * MEBIBYTE))
    constant = 100_000_000 if name in MANY else FEW
    (grown,) = Isolated(name, RecordingError, growth, path)
    assert grown < 4 * path.stat().st_size + constant


def growth(path: Path) -> Iterator[int]:
    """How much more memory (bytes) this process takes at most while it reads the file, within its limit."""
    Path("/proc/self/clear_refs").write_text("5")
    before = peak_memory()
    read(path)
    yield peak_memory() - before


def read(path: Path) -> None:
    try:
        for _ in islice(items(path), ENOUGH):
            pass
    except LidarError as error:
        if isinstance(error.__cause__, MemoryError):
            raise


def items(path: Path) -> Iterator[object]:
    if path.suffix in (".pgm", ".bmp", ".png"):
        path.with_suffix(".yaml").write_text(YAML + path.name)
        yield read_ros_map(path.with_suffix(".yaml"))
    elif path.stem.startswith("map"):
        yield from map_file._read(path, path.suffix[1:])
    else:
        yield from open_recording(path)


def peak_memory() -> int:
    """Largest resident memory of this process in bytes (proc(5): clear_refs, VmHWM)."""
    return 1024 * int(re.search(r"VmHWM:\s+(\d+)", Path("/proc/self/status").read_text())[1])
