"""Observations of walls: by what stretches of segments a wall is told from all others, however the map is bent.

A segment is found in one scan, so its number and where it begins do not change with any pose, nor where the map drops
other scans.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from lidarcore.arrays import Array, Columns, Ints
from lidarcore.mapping.walls.parts import Part
from lidarcore.mapping.walls.pieces import Pieces

_MOST = 2**20  # segments of one scan


@dataclass(frozen=True, slots=True, eq=False)
class Observations(Columns):
    """N stretches of segments, each seen of one wall.

    wall     (N,) which; a segment may have been seen of several, one beside the other
    segment  (N,) number of the segment: later scans have higher ones
    span     (N, 2) m along the segment, from its first end
    """

    wall: Ints
    segment: Ints
    span: Array

    @classmethod
    def none(cls) -> "Observations":
        """Observations of no wall."""
        return cls(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 2)))

    @classmethod
    def of(cls, pieces: Pieces, parts: Sequence[Part], numbers: Ints) -> "Observations":
        """Observations of walls, by their place in the list: what of each of its segments lies between its ends.

        numbers (K,) of the scans stay theirs and rise.
        """
        found = [cls.none()]
        of_scan = np.arange(len(pieces)) - np.searchsorted(pieces.keyframe, pieces.keyframe)
        segments = numbers[pieces.keyframe] * _MOST + of_scan
        for i, part in enumerate(parts):
            t, _ = part.fit.coordinates(pieces.ends[part.members])
            first = t.min(axis=1, keepdims=True)
            span = np.clip([part.low, part.high], first, t.max(axis=1, keepdims=True)) - first
            on = span[:, 1] > span[:, 0]
            found.append(cls(np.full(on.sum(), i), segments[part.members[on]], span[on]))
        return cls.joined(found)

    def renamed(self, names: Ints) -> "Observations":
        """These observations, with names[i] for wall i."""
        return Observations(names[self.wall], self.segment, self.span)

    def lengths(self, walls: int) -> Array:
        """How much (W,) m of segments was seen of each of so many walls, each segment for itself."""
        return np.bincount(self.wall, np.diff(self.span)[:, 0], walls).astype(np.float64)


def common(before: Observations, now: Observations, shape: tuple[int, int]) -> csr_array:
    """How much (B, N) m of segments the walls of both have in common, each segment for itself."""
    order = np.argsort(now.segment, kind="stable")
    sought = now.segment[order]
    first = np.searchsorted(sought, before.segment, "left")
    count = np.searchsorted(sought, before.segment, "right") - first
    i = np.repeat(np.arange(len(before)), count)
    j = order[np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)]
    low = np.maximum(before.span[i, 0], now.span[j, 0])
    high = np.minimum(before.span[i, 1], now.span[j, 1])
    shared = np.maximum(high - low, 0.0)
    result = csr_array((shared, (before.wall[i], now.wall[j])), shape=shape)  # adds up what is at one place
    result.eliminate_zeros()
    return result
