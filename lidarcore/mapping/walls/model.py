"""How lines, ends and corners of walls follow from what was measured, to first order: their covariances all at once.

Four numbers are estimated for each wall: the angle of its normal, its distance along the normal at the centre, and
where it begins and ends along the line, if that was seen. An end in a corner follows from the lines of two walls.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import block_diag, coo_array, csr_array

from lidarcore.arrays import Array
from lidarcore.mapping.walls.ends import End
from lidarcore.mapping.walls.intersections import Intersections
from lidarcore.mapping.walls.parts import Part
from lidarcore.mapping.walls.pieces import Pieces
from lidarcore.mapping.walls.spread import Spread

_ROWS = 6  # of a wall: alpha, r, x and y of the first end, x and y of the second
_AT_ONCE = 240  # rows whose covariances are worked out together
_STATE = 4  # of a wall: angle, distance, beginning, end


@dataclass(frozen=True, slots=True, eq=False)
class WallModel:
    """What the covariances of a map of walls come from.

    rows    (6 W, 4 W) how alpha, r and both ends of W walls follow from what was estimated
    gain    (4 W, 3 K) how that follows the poses of K keyframes
    noise   (4 W, 4 W) its covariance by the sensor's noise
    spread  covariance of the poses
    """

    rows: csr_array
    gain: csr_array
    noise: csr_array
    spread: Spread

    def covariance(self, rows: csr_array) -> Array:
        """(R, R) of quantities that are R linear functions (R, 4 W) of what was estimated."""
        by_noise: Array = (rows @ self.noise @ rows.T).toarray()
        return by_noise + self.spread(csr_array(rows @ self.gain))

    def of_walls(self) -> Array:
        """(W, 6, 6) of alpha, r and both ends of every wall."""
        return self._blocks(self.rows, _ROWS)

    def of_points(self, rows: csr_array) -> Array:
        """(P, 2, 2) of P points, whose x and y are rows (2 P, 4 W)."""
        return self._blocks(rows, 2)

    def _blocks(self, rows: csr_array, size: int) -> Array:
        """(N, size, size) of N times `size` rows, some at a time: all with all would be large."""
        found = [np.empty((0, size, size))]
        step = size * max(1, _AT_ONCE // size)
        for begin in range(0, rows.shape[0], step):
            full = self.covariance(rows[begin : begin + step])
            count = len(full) // size
            blocks = full.reshape(count, size, count, size)
            found.append(blocks[np.arange(count), :, np.arange(count)])
        C = np.concatenate(found)
        return (C + C.swapaxes(1, 2)) / 2  # rounding leaves the two halves apart, and only one is stored

    def ends_of(self, *walls: int) -> csr_array:
        """Rows (4 N, 4 W): x and y of both ends of walls, one after the other."""
        return self.rows[[_ROWS * i + k for i in walls for k in range(2, _ROWS)]]


def wall_model(
    pieces: Pieces,
    parts: list[Part],
    ends: list[tuple[End, End]],
    intersections: Intersections,
    spread: Spread,
    keyframes: int,
    systematic: float,
) -> WallModel:
    """A model of walls with their own ends, those in corners replaced; systematic (m) is that of SensorNoise."""
    blocks = [_noise(part, pair, systematic) for part, pair in zip(parts, ends, strict=True)]
    noise = csr_array(block_diag(blocks, format="csr")) if blocks else csr_array((0, 0))
    rows, gain = _rows(parts, ends, intersections), _gain(pieces, parts, ends, keyframes)
    return WallModel(rows, gain, noise, spread)


def corner_rows(parts: list[Part], i: int, j: int, xy: Array) -> csr_array:
    """Rows (2, 4 W): x and y of the point where the lines of walls i and j meet."""
    entries = _Entries()
    _add_corner(entries, [0, 1], parts, i, j, xy)
    return entries.matrix(2, _STATE * len(parts))


class _Entries:
    """A sparse matrix that is put together block by block; where blocks overlap, they add up."""

    def __init__(self) -> None:
        self._blocks, self._rows, self._columns = (
            [np.empty(0)],
            [np.empty(0, np.int64)],
            [np.empty(0, np.int64)],
        )

    def add(self, block: Array, rows: Sequence[int], columns: ArrayLike) -> None:
        """Add a block (R, C) at these rows (R,) and columns (C,)."""
        row, column = np.meshgrid(rows, columns, indexing="ij")
        self._blocks.append(block.ravel())
        self._rows.append(row.ravel())
        self._columns.append(column.ravel())

    def matrix(self, rows: int, columns: int) -> csr_array:
        """The matrix (rows, columns)."""
        places = np.concatenate(self._rows), np.concatenate(self._columns)
        return csr_array(coo_array((np.concatenate(self._blocks), places), shape=(rows, columns)))


def _noise(part: Part, ends: tuple[End, End], systematic: float) -> Array:
    half = max(part.length / 2, 1e-3)
    block = np.zeros((_STATE, _STATE))
    block[:2, :2] = part.fit.noise + systematic**2 * np.diag([1 / half**2, 1.0])
    block[2, 2], block[3, 3] = ends[0].variance, ends[1].variance
    return block


def _gain(pieces: Pieces, parts: list[Part], ends: list[tuple[End, End]], keyframes: int) -> csr_array:
    entries = _Entries()
    for i, (part, pair) in enumerate(zip(parts, ends, strict=True)):
        told = [(part.members, part.fit.gain[:, 0]), (part.members, part.fit.gain[:, 1])]
        told += [(end.members, end.gain) for end in pair]
        for k, (members, gain) in enumerate(told):
            columns = 3 * pieces.keyframe[members][:, None] + np.arange(3)
            entries.add(gain, [_STATE * i + k], columns.ravel())
    return entries.matrix(_STATE * len(parts), 3 * keyframes)


def _rows(parts: list[Part], ends: list[tuple[End, End]], intersections: Intersections) -> csr_array:
    """alpha, r and both ends: r changes with the angle by the centre's way along the line."""
    entries, corners = _Entries(), intersections
    met = set(zip(corners.walls[:, 0].tolist(), corners.side.tolist(), strict=True))
    for i, (part, pair) in enumerate(zip(parts, ends, strict=True)):
        n, u = part.fit.normal, part.fit.along
        sign = 1.0 if n @ part.fit.centre >= 0 else -1.0
        line = np.array([[1.0, 0.0], [sign * (u @ part.fit.centre), sign]])
        entries.add(line, [_ROWS * i, _ROWS * i + 1], [_STATE * i, _STATE * i + 1])
        for side, end in enumerate(pair):
            if (i, side) not in met:
                moved = np.stack([-end.t * n, n, u], -1)  # by angle, distance and the end itself
                entries.add(moved, _rows_of_end(i, side), [_STATE * i, _STATE * i + 1, _STATE * i + 2 + side])
    for (i, j), side, xy in zip(corners.walls.tolist(), corners.side.tolist(), corners.xy, strict=True):
        _add_corner(entries, _rows_of_end(i, side), parts, i, j, xy)
    return entries.matrix(_ROWS * len(parts), _STATE * len(parts))


def _rows_of_end(i: int, side: int) -> list[int]:
    """Rows of x and y of one end of wall i."""
    return [_ROWS * i + 2 + 2 * side, _ROWS * i + 3 + 2 * side]


def _add_corner(entries: _Entries, rows: Sequence[int], parts: list[Part], i: int, j: int, xy: Array) -> None:
    """How x and y of the point where the lines of walls i and j meet follow from both."""
    fits = parts[i].fit, parts[j].fit
    N = np.stack([fit.normal for fit in fits])
    # A line moves at xy by its distance's change, less its turn times the way from its centre.
    lines = np.zeros((2, 4))
    lines[0, :2] = -((xy - fits[0].centre) @ fits[0].along), 1.0
    lines[1, 2:] = -((xy - fits[1].centre) @ fits[1].along), 1.0
    columns = [_STATE * i, _STATE * i + 1, _STATE * j, _STATE * j + 1]
    entries.add(np.linalg.solve(N, lines).astype(np.float64), rows, columns)
