"""A map as a folder of files, all of them or none."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array
from lidarcore.errors import MapFileError
from lidarcore.files import reason, replacing_all
from lidarcore.mapping.export.drawings import corner_places, map_png, plan_dxf, plan_svg
from lidarcore.mapping.export.tables import read_walls_csv, walls_csv, walls_geojson
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.grid.ros_map import ros_pgm, ros_yaml
from lidarcore.mapping.walls import JointWalls, WallTable, pack_covariance, unpack_covariance

MAP_FILES: dict[str, Callable[[OccupancyGrid, WallTable, Array], bytes]] = {
    "map.pgm": lambda grid, walls, path: ros_pgm(grid),
    "map.yaml": lambda grid, walls, path: ros_yaml(grid, "map.pgm").encode(),
    "walls.csv": lambda grid, walls, path: walls_csv(walls).encode(),
    "walls.geojson": lambda grid, walls, path: walls_geojson(walls).encode(),
    "plan.svg": lambda grid, walls, path: plan_svg(walls.ends, corner_places(walls), path).encode(),
    "plan.dxf": lambda grid, walls, path: plan_dxf(walls.ends, corner_places(walls), path).encode(),
    "map.png": map_png,
}
"""The files of a map by name, and what makes each of grid, walls and the path (T, 2) m of the sensor."""
COVARIANCE_FILE = "walls_covariance.bin"
"""How the walls of walls.csv err together, as `pack_covariance` gives it, if that is known of so many."""


def read_walls(folder: str | Path) -> WallTable:
    """The walls of a folder of a map, which can be measured if COVARIANCE_FILE is there.

    Raises MapFileError, which names what is wrong, if it is no folder, or walls.csv or that file cannot be read.
    """
    _check_no_file(Path(folder))
    walls, path = read_walls_csv(Path(folder) / "walls.csv"), Path(folder) / COVARIANCE_FILE
    if not path.is_file():
        return walls
    try:
        return unpack_covariance(path.read_bytes(), walls)
    except (OSError, MapFileError) as error:
        why = reason(error).rstrip(".")
        raise MapFileError(f"{path.name}: {why}. Without this file the walls can be read.") from error


def write_map(
    folder: str | Path,
    grid: OccupancyGrid,
    walls: WallTable,
    path: ArrayLike = (),
    texts: Mapping[str, str] | None = None,
) -> None:
    """Write MAP_FILES into a folder, which is made if need be; what was there under these names is replaced.

    With walls that can be measured COVARIANCE_FILE is written, too; of others it is not there.

    path   (T, 2) or (T, 3) m: where the sensor was, for the pictures
    texts  further text files by name, such as poses.csv

    Raises MapFileError if it is no folder, or a file cannot be written; the folder is as it was then.
    """
    _check_no_file(Path(folder))
    folder, packed = Path(folder), pack_covariance(walls) if isinstance(walls, JointWalls) else None
    others = {name: text.encode() for name, text in (texts or {}).items()}
    others |= {} if packed is None else {COVARIANCE_FILE: packed}
    poses = np.asarray(path, np.float64)
    way = poses[:, :2] if len(poses) else np.empty((0, 2))
    made = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with replacing_all(*(folder / name for name in (*MAP_FILES, *others))) as parts:
            for content_of, part in zip(MAP_FILES.values(), parts, strict=False):
                part.write_bytes(content_of(grid, walls, way))
            for content, part in zip(others.values(), parts[len(MAP_FILES) :], strict=True):
                part.write_bytes(content)
        if packed is None:
            (folder / COVARIANCE_FILE).unlink(missing_ok=True)
    except OSError as error:
        if made and folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
        raise MapFileError(f"The map cannot be written to {folder}: {reason(error)}.") from error


def _check_no_file(path: Path) -> None:
    if path.is_file():
        raise MapFileError(f"{path} is a file: give the folder of the map, such as {path.parent}.")
