"""JSON files of point sets, one for each of several sensors: {"name": [[x, y], ...], ...}."""

import json
import re
from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import partial
from typing import IO

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import RecordingError
from lidarcore.recordings.base import Recording
from lidarcore.scan import Scan

PIECE = 1 << 16  # bytes that are taken apart at a time
MOST_SETS = 1000
_NAME = re.compile(rb'\s*[{,]\s*("(?:[^"\\]|\\.)*")\s*:\s*\[')
_LIST_END = re.compile(rb"(?:(?<=\])|\A)\s*\]")  # after the last point, or at once if all were read
_END = re.compile(rb"\s*\}\s*\Z")


class PointSets(Recording):
    """One scan of each sensor, as points (x m, y m) in its frame; the sensors are the topics."""

    name = "JSON point sets"
    signature = re.compile(rb'\A\s*\{\s*"[^"]*"\s*:\s*\[\s*\[\s*[-\d]')

    def _open(self, topic: str | None) -> None:
        sets: defaultdict[str, list[Array]] = defaultdict(list)
        with self._stream() as stream:
            for name, points in _pieces(stream):
                if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
                    raise RecordingError(f"{name} in {self.path.name} is not a list of points [x, y] in m.")
                sets[name].append(points)
                self._check_beams(sum(map(len, sets[name])))
                if len(sets) > MOST_SETS:
                    raise self._error(f"holds more than {MOST_SETS} point sets: give some of them.")
        self._choose(sets, topic)
        self._points = np.concatenate(sets[str(self.topic)])
        self._remark("Beams without a return are not in the file.")

    def _scans(self) -> Iterator[Callable[[], Scan]]:
        yield partial(_scan, self._points)


def _pieces(stream: IO[bytes]) -> Iterator[tuple[str, Array]]:
    """Names and some of their points (N, 2): in one piece, a file takes twenty times its size as Python's objects.

    Raises ValueError or EOFError if the file is not of that form.
    """
    text = stream.read(PIECE)
    while head := _NAME.match(text):
        name, text, is_empty = json.loads(head[1]), text[head.end() :], True
        end = None
        while end is None:
            end = _LIST_END.search(text)
            cut = end.start() if end else text.rfind(b"]") + 1
            if end is None and not cut:
                raise EOFError(f"the points of {name} do not end")
            if is_empty or text[:cut].strip():
                yield name, np.array(json.loads(b"[" + text[:cut].strip(b", \r\n\t") + b"]"), np.float64)
            is_empty = False
            text = text[end.end() if end else cut :]
            more = stream.read(PIECE) if len(text) < PIECE else b""
            if not (end or more):
                raise EOFError(f"the points of {name} do not end")
            text += more
    if not _END.match(text):
        raise ValueError(f"there is {text[:40]!r} where a name or the end should be")


def _scan(points: Array) -> Scan:
    return Scan(np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0]))
