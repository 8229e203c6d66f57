"""How lines, ends and corners of walls follow from what was measured, to first order: their covariances all at once.

Four numbers are estimated for each wall: the angle of its normal, its distance along the normal at the centre, and
where it begins and ends along the line, if that was seen. An end in a corner follows from the lines of two walls.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import block_diag, coo_array, csr_array

from lidarcore.arrays import Array, Ints
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
    rows = _line_rows(parts) + _end_rows(parts, ends, intersections)
    noise = csr_array(block_diag(blocks, format="csr")) if blocks else csr_array((0, 0))
    return WallModel(rows, _gain(pieces, parts, ends, keyframes), noise, spread)


def corner_rows(parts: list[Part], i: int, j: int, xy: Array) -> csr_array:
    """Rows (2, 4 W): x and y of the point where the lines of walls i and j meet."""
    fits = parts[i].fit, parts[j].fit
    N = np.stack([fit.normal for fit in fits])
    # A line moves at xy by its distance's change, less its turn times the way from its centre.
    lines = np.zeros((2, 4))
    lines[0, :2] = -((xy - fits[0].centre) @ fits[0].along), 1.0
    lines[1, 2:] = -((xy - fits[1].centre) @ fits[1].along), 1.0
    moved: Array = np.linalg.solve(N, lines).astype(np.float64)
    columns = np.array([_STATE * i, _STATE * i + 1, _STATE * j, _STATE * j + 1])
    return _sparse(moved, np.arange(2), columns, (2, _STATE * len(parts)))


def _noise(part: Part, ends: tuple[End, End], systematic: float) -> Array:
    half = max(part.length / 2, 1e-3)
    block = np.zeros((_STATE, _STATE))
    block[:2, :2] = part.fit.noise + systematic**2 * np.diag([1 / half**2, 1.0])
    block[2, 2], block[3, 3] = ends[0].variance, ends[1].variance
    return block


def _gain(pieces: Pieces, parts: list[Part], ends: list[tuple[End, End]], keyframes: int) -> csr_array:
    entries, rows, columns = [np.empty(0)], [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for i, (part, pair) in enumerate(zip(parts, ends, strict=True)):
        told = [(part.members, part.fit.gain[:, 0]), (part.members, part.fit.gain[:, 1])]
        told += [(end.members, end.gain) for end in pair]
        for k, (members, gain) in enumerate(told):
            entries.append(gain.ravel())
            rows.append(np.full(gain.size, _STATE * i + k))
            columns.append((3 * pieces.keyframe[members][:, None] + np.arange(3)).ravel())
    places = np.concatenate(rows), np.concatenate(columns)
    return csr_array(coo_array((np.concatenate(entries), places), shape=(_STATE * len(parts), 3 * keyframes)))


def _line_rows(parts: list[Part]) -> csr_array:
    """alpha and r: the distance from the origin changes with the angle by the centre's way along the line."""
    entries, rows, columns = [], [], []
    for i, part in enumerate(parts):
        sign = 1.0 if part.fit.normal @ part.fit.centre >= 0 else -1.0
        entries += [1.0, sign * float(part.fit.along @ part.fit.centre), sign]
        rows += [_ROWS * i, _ROWS * i + 1, _ROWS * i + 1]
        columns += [_STATE * i, _STATE * i, _STATE * i + 1]
    return csr_array(
        coo_array(
            (entries, (rows, columns)), shape=(_ROWS * len(parts), _STATE * len(parts)), dtype=np.float64
        )
    )


def _end_rows(parts: list[Part], ends: list[tuple[End, End]], intersections: Intersections) -> csr_array:
    shape = (_ROWS * len(parts), _STATE * len(parts))
    total = csr_array(shape)
    met = {(int(i), int(side)) for (i, _), side in zip(intersections.walls, intersections.side, strict=True)}
    data, rows, columns = [], [], []
    for i, part in enumerate(parts):
        for side in (0, 1):
            if (i, side) in met:
                continue
            n, u, t = part.fit.normal, part.fit.along, ends[i][side].t
            moved = np.stack([-t * n, n, u], -1)  # by angle, distance and the end itself
            row, column = np.meshgrid(
                _ROWS * i + 2 + 2 * side + np.arange(2),
                _STATE * i + np.array([0, 1, 2 + side]),
                indexing="ij",
            )
            data.append(moved.ravel())
            rows.append(row.ravel())
            columns.append(column.ravel())
    for (i, j), side, xy in zip(intersections.walls, intersections.side, intersections.xy, strict=True):
        corner = corner_rows(parts, int(i), int(j), xy).tocoo()
        data.append(corner.data)
        rows.append(corner.coords[0] + _ROWS * i + 2 + 2 * side)
        columns.append(corner.coords[1])
    if not data:
        return total
    places = np.concatenate(rows), np.concatenate(columns)
    return csr_array(coo_array((np.concatenate(data), places), shape=shape))


def _sparse(block: Array, rows: Ints, columns: Ints, shape: tuple[int, int]) -> csr_array:
    row, column = np.meshgrid(rows, columns, indexing="ij")
    return csr_array(coo_array((block.ravel(), (row.ravel(), column.ravel())), shape=shape))
