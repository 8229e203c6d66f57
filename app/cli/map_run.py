"""A whole recording becomes a map: poses with covariances, and files of them."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lidarcore import Scan
from lidarcore.errors import MotionError
from lidarcore.mapping import Mapper, MapperSettings
from lidarcore.mapping.export import COVARIANCE_FILE, MAP_FILES, write_map
from lidarcore.mapping.grid import build_grid
from lidarcore.mapping.walls import Walls, find_walls

from ..pipeline.settings import Settings
from ..pipeline.tables import csv_text
from .localization_run import COLUMNS

POSES = "poses.csv"


@dataclass(frozen=True)
class Built:
    """A finished mapper, "tracking" or "lost" for each scan that it took, and why it left out the others."""

    mapper: Mapper
    states: list[str]
    left_out: list[str]


def mapper_settings(settings: Settings) -> MapperSettings:
    """The mapper's defaults with the noise of the sensor."""
    return MapperSettings().with_noise(settings.extraction.noise)


def without_odometry(scans: Iterable[Scan]) -> Iterator[Scan]:
    """The scans, without what they say of how the sensor moved."""
    return (replace(scan, odometry=None) for scan in scans)


def build(scans: Iterable[Scan], settings: Settings, progress: Callable[[int], None]) -> Built:
    """Map the scans of a recording; `progress` is told the number of scans. Raises RecordingError."""
    mapper, states, left_out = Mapper(mapper_settings(settings)), list[str](), list[str]()
    for number, scan in enumerate(scans, 1):
        try:
            states.append("tracking" if mapper.step(scan).connected else "lost")
        except MotionError as error:
            left_out.append(f"scan {number}: {str(error).partition(':')[0]}")
        progress(number)
    mapper.finish()
    return Built(mapper, states, left_out)


def files_of_a_map(folder: Path) -> list[str]:
    """Names of what is in a folder that the files of a map would replace, or that would no longer fit to them."""
    return [name for name in (*MAP_FILES, COVARIANCE_FILE, POSES) if (folder / name).exists()]


def write_files(folder: Path, built: Built, settings: Settings) -> Walls:
    """All files of the map, or none; its walls. Raises GridError or MapFileError."""
    views, poses = built.mapper.views, built.mapper.trajectory()[1]
    grid = build_grid(views.scans, views.poses)
    walls = find_walls(views.scans, views.poses, views.covariances, grid, extraction=settings.extraction)
    write_map(folder, grid, walls, poses, {POSES: poses_csv(built)})
    return walls


def poses_csv(built: Built) -> str:
    """The poses of all scans, as the finished map has them."""
    stamps, poses = built.mapper.trajectory()
    upper = built.mapper.covariances()[:, *np.triu_indices(3)]
    columns = [stamps.tolist(), built.states, *poses.T.tolist(), *upper.T.tolist()]
    return csv_text(dict(zip(COLUMNS, columns, strict=False)))
