"""What a file may cost beside what the process takes that reads it: four times its size, and 100 MB."""

from pathlib import Path

import pytest
from large_files import MEBIBYTE, NAMES, make
from lidarcore_app.isolation import Isolated
from reading import growth

from lidarcore import RecordingError

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


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_a_file_of_many_small_things_takes_little_memory(tmp_path: Path, name: str) -> None:
    path = make(tmp_path, name, int(SIZES.get(name, USUAL) * MEBIBYTE))
    constant = 100_000_000 if name in MANY else FEW
    (grown,) = Isolated(name, RecordingError, growth, path)
    assert grown < 4 * path.stat().st_size + constant
