"""JSON files of point sets, one for each of several sensors: {"name": [[x, y], ...], ...}."""

import math
import re
from array import array
from collections.abc import Callable, Iterator
from functools import partial
from io import TextIOWrapper

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import RecordingError
from lidarcore.files.json_reader import JsonReader
from lidarcore.recordings.base import Recording
from lidarcore.scan import Scan

MOST_SETS = 1000


class PointSets(Recording):
    """One scan of each sensor, as points (x m, y m) in its frame; the sensors are the topics."""

    name = "JSON point sets"
    signature = re.compile(rb'\A\s*\{\s*"[^"]*"\s*:\s*\[\s*\[\s*[-\d]')

    def _open(self, topic: str | None) -> None:
        sets: dict[str, Array] = {}
        with self._stream() as stream:
            reader = JsonReader(TextIOWrapper(stream, "utf-8"))
            for name in reader.members():
                sets[name] = self._points(name, reader)
                if len(sets) > MOST_SETS:
                    raise self._error(f"holds more than {MOST_SETS} point sets: give some of them.")
            if reader.next():
                raise ValueError("there is more text after the end of the object")
        self._choose(sets, topic)
        self._chosen = sets[str(self.topic)]
        self._remark("Beams without a return are not in the file.")

    def _points(self, name: str, reader: JsonReader) -> Array:
        """The points (N, 2) of one sensor, not as Python's objects, which take twenty times as much as the file."""
        flat = array("d")
        for point in reader.items():
            match point:
                case [int() | float() as x, int() | float() as y] if math.isfinite(x) and math.isfinite(y):
                    flat.extend((x, y))
                case _:
                    raise RecordingError(f"{name} in {self.path.name} is not a list of points [x, y] in m.")
            self._check_beams(len(flat) // 2)
        return np.array(flat).reshape(-1, 2)

    def _scans(self) -> Iterator[Callable[[], Scan]]:
        yield partial(_scan, self._chosen)


def _scan(points: Array) -> Scan:
    return Scan(np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0]))
