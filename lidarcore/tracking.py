"""Corners matched across methods by their pair of segments, and followed from frame to frame."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidarcore.features import Features

GATE = 0.3  # m: a corner found farther away than this is another one
MEMORY = 10  # frames a corner may be missing and still keep its id, if not told otherwise


@dataclass(frozen=True, slots=True)
class CornerRow:
    """One corner of the scan: its segments in the first method that found it, its index in each that did."""

    id: int
    segments: tuple[int, int]
    index: Mapping[str, int]


def match(features: Mapping[str, Features]) -> list[dict[str, int]]:
    """Corners of several methods on one segmentation: for each, {method: its index there}.

    The pair of segments is known by the beams that face each other, since indices of segments differ where
    one method rejected a piece that another one took.
    """
    rows: dict[tuple[int, int], dict[str, int]] = {}
    for name, found in features.items():
        first, second = found.corners.segments.T
        ends, starts = found.segments.last_beam[first], found.segments.first_beam[second]
        for i, pair in enumerate(zip(ends.tolist(), starts.tolist(), strict=True)):
            rows.setdefault(pair, {})[name] = i
    return list(rows.values())


@dataclass
class Tracker:
    """Gives every corner an id that it keeps while it stays within GATE of where it last was.

    memory   frames a corner may be missing and still keep its id
    follow   share of the way to a new sighting that its known place goes: all of it, or less where nothing moves, so
             that one gross error does not make two corners of one
    """

    memory: int = MEMORY
    follow: float = 1.0
    _seen: dict[int, tuple[NDArray[np.float64], int]] = field(default_factory=dict)
    _frame: int = 0
    _next_id: int = 1

    def forget(self) -> None:
        """Another scene: no corner of it is one seen before. Ids are never used again."""
        self._seen.clear()

    def rows(self, features: Mapping[str, Features]) -> tuple[CornerRow, ...]:
        """The corners of one frame with their ids; positions are those of the first method that has them."""
        rows = match(features)
        found = [(features[name].corners, i) for name, i in (next(iter(row.items())) for row in rows)]
        ids = self._identify(np.array([corners.xy[i] for corners, i in found]).reshape(-1, 2))
        pairs = [(int(corners.segments[i, 0]), int(corners.segments[i, 1])) for corners, i in found]
        return tuple(CornerRow(*row) for row in zip(ids, pairs, rows, strict=True))

    def _identify(self, xy: NDArray[np.float64]) -> list[int]:
        self._frame += 1
        self._seen = {i: seen for i, seen in self._seen.items() if self._frame - seen[1] <= self.memory}
        ids = self._nearest(xy)
        for row, at in enumerate(xy):
            if ids[row] == 0:
                ids[row], self._next_id = self._next_id, self._next_id + 1
            known, _ = self._seen.get(ids[row], (at, 0))
            self._seen[ids[row]] = (known + self.follow * (at - known), self._frame)
        return ids

    def _nearest(self, xy: NDArray[np.float64]) -> list[int]:
        """The known id for each position, closest pairs first, each id once; 0 where none is near."""
        ids = [0] * len(xy)
        known = list(self._seen)
        if not known or not len(xy):
            return ids
        distances = np.linalg.norm(xy[:, None] - np.array([self._seen[i][0] for i in known]), axis=2)
        for row, column in np.argwhere(distances <= GATE)[np.argsort(distances[distances <= GATE])].tolist():
            if ids[row] == 0 and known[column] not in ids:
                ids[row] = known[column]
        return ids
