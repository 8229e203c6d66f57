"""JSON files of point sets, one for each of several sensors: {"name": [[x, y], ...], ...}."""

import json
import re
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from lidarcore.errors import RecordingError
from lidarcore.recordings.base import Recording
from lidarcore.scan import Array, Scan


class PointSets(Recording):
    """One scan of each sensor, as points (x m, y m) in its frame; the sensors are the topics."""

    name = "JSON point sets"
    signature = re.compile(rb'\A\s*\{\s*"[^"]*"\s*:\s*\[\s*\[\s*[-\d]')

    def _open(self, topic: str | None) -> None:
        sets = {name: np.array(points, np.float64) for name, points in json.loads(self._content()).items()}
        for name, points in sets.items():
            if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
                raise RecordingError(f"{name} in {self.path.name} is not a list of points [x, y] in m.")
        self._choose(sets, topic)
        self._points = sets[str(self.topic)]
        self._remark("Beams without a return are not in the file.")

    def _scans(self) -> Iterator[Callable[[], Scan]]:
        yield partial(_scan, self._points)


def _scan(points: Array) -> Scan:
    return Scan(np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0]))
