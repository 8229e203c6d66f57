"""A map as a folder of files, all of them or none."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array
from lidarcore.errors import MapFileError
from lidarcore.files import replacing_all
from lidarcore.mapping.export.picture import map_png
from lidarcore.mapping.export.plan import plan_dxf, plan_svg
from lidarcore.mapping.export.tables import walls_csv, walls_geojson
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.grid.ros_map import ros_yaml, write_pgm
from lidarcore.mapping.walls import Walls

Writer = Callable[[OccupancyGrid, Walls, Array, Path], None]


def write_map(
    folder: str | Path,
    grid: OccupancyGrid,
    walls: Walls,
    path: ArrayLike = (),
    texts: Mapping[str, str] | None = None,
) -> None:
    """Write MAP_FILES into a folder, which is made if need be; what was there under these names is replaced.

    path   (T, 2) or (T, 3) m: where the sensor was, for the pictures
    texts  further text files by name, such as poses.csv

    Raises MapFileError if a file cannot be written; the folder is as it was then.
    """
    folder, texts = Path(folder), texts or {}
    poses = np.asarray(path, np.float64)
    way = poses[:, :2] if len(poses) else np.empty((0, 2))
    made = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with replacing_all(*(folder / name for name in (*MAP_FILES, *texts))) as parts:
            for write, part in zip(MAP_FILES.values(), parts, strict=False):
                write(grid, walls, way, part)
            for text, part in zip(texts.values(), parts[len(MAP_FILES) :], strict=True):
                part.write_text(text, "utf-8", newline="")
    except OSError as error:
        if made and folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
        raise MapFileError(f"The map cannot be written to {folder}: {error}.") from error


def _pgm(grid: OccupancyGrid, walls: Walls, path: Array, file: Path) -> None:
    write_pgm(grid, file)


def _yaml(grid: OccupancyGrid, walls: Walls, path: Array, file: Path) -> None:
    file.write_text(ros_yaml(grid, "map.pgm"), "utf-8")


def _csv(grid: OccupancyGrid, walls: Walls, path: Array, file: Path) -> None:
    file.write_text(walls_csv(walls), "utf-8", newline="")


def _geojson(grid: OccupancyGrid, walls: Walls, path: Array, file: Path) -> None:
    file.write_text(walls_geojson(walls), "utf-8", newline="")


def _svg(grid: OccupancyGrid, walls: Walls, path: Array, file: Path) -> None:
    file.write_text(plan_svg(walls, path), "utf-8", newline="")


def _dxf(grid: OccupancyGrid, walls: Walls, path: Array, file: Path) -> None:
    file.write_text(plan_dxf(walls, path), "utf-8")


def _png(grid: OccupancyGrid, walls: Walls, path: Array, file: Path) -> None:
    with file.open("wb") as stream:
        map_png(grid, walls, path, stream)


MAP_FILES: dict[str, Writer] = {
    "map.pgm": _pgm,
    "map.yaml": _yaml,
    "walls.csv": _csv,
    "walls.geojson": _geojson,
    "plan.svg": _svg,
    "plan.dxf": _dxf,
    "map.png": _png,
}
"""The files of a map by name, and what writes each."""
