"""A whole recording's poses, and the map that they make or lie in, into files."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lidarcore import RecordingError, Scan, extract
from lidarcore.clusters import cluster
from lidarcore.errors import MapFileError
from lidarcore.files import replacing
from lidarcore.landmarks import FORMATS, read_landmarks, write_landmarks
from lidarcore.localization import Landmarks, Navigator, TrackingResult, from_stored, to_stored
from lidarcore.mapping import MapPicture, WholeScans
from lidarcore.mapping.grid import read_ros_map
from lidarcore.recordings import Recording

from ..pipeline.navigation import SIGMA_HEADING, SIGMA_POSITION
from ..pipeline.settings import Settings

GRIDS = (".yaml", ".yml")

COLUMNS = (
    "stamp", "state", "x", "y", "heading", "var_x", "cov_xy", "cov_x_heading", "var_y", "cov_y_heading", "var_heading",
    "matched", "nis", "dof",
)  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """What a recording gave: columns of the poses, how many scans, how many of them tracked, and landmarks, if any.

    message is what was wrong at the last scan, or None.
    """

    columns: dict[str, list[object]]
    scans: int
    tracked: int
    landmarks: Landmarks | None
    message: str | None


def track(
    recording: Recording, tracker: Navigator | WholeScans, settings: Settings, progress: Callable[[int], None]
) -> Outcome:
    """Take all scans of a recording; `progress` is told the number of scans. Raises RecordingError."""
    columns: dict[str, list[object]] = {name: [] for name in COLUMNS}
    tracked, message = 0, None
    for number, scan in enumerate(recording, 1):
        found = _step(tracker, scan, settings)
        for name, value in zip(COLUMNS, _row(found), strict=True):
            columns[name].append(value)
        tracked += found.state == "tracking"
        message = found.message
        progress(number)
    landmarks = tracker.landmarks if isinstance(tracker, Navigator) else None
    return Outcome(columns, len(columns["stamp"]), tracked, landmarks, message)


def tracker_in(path: Path | None, settings: Settings) -> Navigator | WholeScans:
    """What localizes in the map of a file, or builds one by SLAM. Raises MapFileError, LandmarkMapError or OSError."""
    if path is None:
        return Navigator(replace(settings.navigation, mode="slam"))
    if path.is_dir():
        path = path / "map.yaml"
    is_grid = path.suffix.lower() in GRIDS
    format = "" if is_grid else format_of(path, GRIDS)
    if not path.exists():
        raise MapFileError(
            f"There is no map {path}: give its file, or the folder that `lidarcore map` wrote."
        )
    if is_grid:
        return WholeScans(settings.extraction, known=MapPicture(read_ros_map(path)), background=False)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            known = from_stored(read_landmarks(file, format))
    except MapFileError as error:
        raise MapFileError(f"{path.name}: {error}") from error
    return Navigator(replace(settings.navigation, mode="localize"), known)


def place(tracker: Navigator | WholeScans, pose: Sequence[float]) -> None:
    """Say where the first scan was taken, about: m, m, rad. Raises LocalizationError."""
    tracker.place(pose, np.diag([SIGMA_POSITION, SIGMA_POSITION, SIGMA_HEADING]) ** 2)


def write_map(path: Path, landmarks: Landmarks, method: str) -> None:
    """The confirmed landmarks; the file appears when complete."""
    with replacing(path) as partial, partial.open("w", encoding="utf-8", newline="") as file:
        write_landmarks(to_stored(landmarks, method), file, format_of(path))


def format_of(path: Path, others: Sequence[str] = ()) -> str:
    """The format of a file of landmarks by its suffix; `others` would do as well. Raises RecordingError."""
    if not path.name:
        raise RecordingError("The file of the map has no name: give one, such as map.json.")
    name = path.suffix.lower().removeprefix(".")
    if name not in FORMATS:
        endings = (*(f".{known}" for known in FORMATS), *others)
        raise RecordingError(f"{path.name} should end in one of {', '.join(endings)}.")
    return name


def _step(tracker: Navigator | WholeScans, scan: Scan, settings: Settings) -> TrackingResult:
    scan = tracker.deskewed(scan)
    if isinstance(tracker, WholeScans):
        return tracker.step(scan)
    features = extract(scan, settings.extraction)
    return tracker.step(scan, features, cluster(scan, settings.clusters) if settings.clustered else None)


def _row(found: TrackingResult) -> tuple[object, ...]:
    pose, covariance = found.estimate.pose.tolist(), found.estimate.covariance[np.triu_indices(3)].tolist()
    return (found.stamp, found.state, *pose, *covariance, len(found.pairs), found.nis, found.dof)
