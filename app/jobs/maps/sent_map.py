"""A map that somebody sent, read in a process of its own."""

import tempfile
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile, ZipFile

from lidarcore.errors import MapFileError
from lidarcore.files import reason
from lidarcore.landmarks import Landmark, read_landmarks
from lidarcore.mapping.export import COVARIANCE_FILE, read_walls
from lidarcore.mapping.grid import OccupancyGrid, read_ros_map
from lidarcore.mapping.walls import WallTable

from ...isolation import Isolated

MOST = 250_000  # landmarks, which take 100 MB; a house has some hundred
_YAMLS = (".yaml", ".yml")
_PARTS = (*_YAMLS, ".pgm", ".png", ".bmp")
_WALLS = "walls.csv"  # beside the YAML, as the next one
_MOST_PARTS, _MOST_BYTES = 20, 200_000_000  # of a zip, unpacked
_TOGETHER = 1000  # landmarks that come over at a time


def landmarks_of(path: Path, format: str) -> list[Landmark]:
    """The landmarks of a file (one of FORMATS), without ids. Raises MapFileError, also if there are more than MOST."""
    with closing(Isolated(f"the {format}", MapFileError, _read, path, format)) as reading:
        found: list[Landmark] = []
        for together in reading:
            found += (replace(landmark, id=None) for landmark in together)
            if len(found) > MOST:
                raise MapFileError(f"This {format} holds more than {MOST} landmarks: load a part of it.")
    return found


class Building(NamedTuple):
    """A grid, and the walls that came with it; they can be measured if it came along how they err together."""

    grid: OccupancyGrid
    walls: WallTable | None


def building_of(path: Path) -> Building:
    """The grid of a zip with a YAML and its image, as ROS has them, and the walls if walls.csv is there as well.

    Raises MapFileError or GridError.
    """
    # A folder of this process: the one that reads is killed once it has read, and might leave it behind.
    with (
        tempfile.TemporaryDirectory(prefix="lidarcore-map-") as folder,
        closing(Isolated("the map", MapFileError, _read_building, path, Path(folder))) as reading,
    ):
        return next(iter(reading))


def _read_building(path: Path, folder: Path) -> Iterator[Building]:
    yaml = _unpacked(path, folder)
    has_walls = yaml.with_name(_WALLS).is_file()
    yield Building(read_ros_map(yaml), read_walls(yaml.parent) if has_walls else None)


def _unpacked(path: Path, folder: Path) -> Path:
    """The only YAML of a zip, unpacked with the images and files of walls into a folder; others stay where they are."""
    try:
        with ZipFile(path) as archive:
            parts = [part for part in archive.infolist() if _is_read(Path(part.filename))]
            yamls = [part for part in parts if Path(part.filename).suffix.lower() in _YAMLS]
            if len(yamls) != 1:
                raise MapFileError(
                    f"This zip holds {len(yamls)} YAML files: pack one with its image, as ROS has them."
                )
            if len(parts) > _MOST_PARTS or sum(part.file_size for part in parts) > _MOST_BYTES:
                raise MapFileError(
                    f"This zip holds more than {_MOST_PARTS} files or {_MOST_BYTES} bytes: pack one map."
                )
            return [Path(archive.extract(part, folder)) for part in (*parts, *yamls)][-1]
    except (BadZipFile, NotImplementedError, RuntimeError, OSError) as error:
        raise MapFileError(f"This zip cannot be read: {reason(error)}.") from error


def _is_read(part: Path) -> bool:
    return part.suffix.lower() in _PARTS or part.name in (_WALLS, COVARIANCE_FILE)


def _read(path: Path, format: str) -> Iterator[list[Landmark]]:
    with path.open(encoding="utf-8-sig", newline="") as text:
        found = read_landmarks(text, format)
        while together := list(islice(found, _TOGETHER)):
            yield together
