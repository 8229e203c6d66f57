"""Reading a foreign file of any kind, and what that takes."""

import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from lidarcore_app.jobs.maps import sent_map

from lidarcore import LidarError
from lidarcore.landmarks import Atlas
from lidarcore.mapping.grid import read_ros_map
from lidarcore.recordings import open_recording

ENOUGH = 5000  # scans of a recording: opening has gone through all of it before the first
PICTURES = (".pgm", ".bmp", ".png")
YAML = "resolution: 1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\nimage: "


def growth(path: Path) -> Iterator[int]:
    """How much more memory (bytes) this process takes at most while it reads the file, within its limit."""
    Path("/proc/self/clear_refs").write_text("5")
    before = peak_memory()
    read(path)
    yield peak_memory() - before


def read(path: Path) -> None:
    """Read the file; what is wrong with it may be said. Raises if that took too much memory, or is no LidarError."""
    try:
        for _ in islice(items(path), ENOUGH):
            pass
    except LidarError as error:
        if isinstance(error.__cause__, MemoryError):
            raise


def items(path: Path) -> Iterator[object]:
    """Scans, landmarks or the grid of a file."""
    if path.suffix in PICTURES:
        path.with_suffix(".yaml").write_text(YAML + path.name)
    if path.suffix in (*PICTURES, ".yaml"):
        yield read_ros_map(path.with_suffix(".yaml"))
    elif path.suffix == ".db":
        with Atlas(path) as atlas:
            for session in atlas.sessions():
                yield from atlas[session.id]
    elif path.stem.startswith("map"):
        yield from sent_map._read(path, path.suffix[1:])
    else:
        yield from open_recording(path)


def peak_memory() -> int:
    """Largest resident memory of this process in bytes (proc(5): clear_refs, VmHWM)."""
    return 1024 * int(re.search(r"VmHWM:\s+(\d+)", Path("/proc/self/status").read_text())[1])
