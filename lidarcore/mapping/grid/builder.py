"""An occupancy grid that grows with the scans, and is made anew when their poses were corrected."""

from collections.abc import Iterable

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.errors import GridError
from lidarcore.geometry import unit_vectors
from lidarcore.mapping.grid.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from lidarcore.mapping.grid.rays import Evidence, mark_scan
from lidarcore.mapping.grid.settings import GridSettings
from lidarcore.scan import Scan

_STEP = 0.05  # log-odds are kept in bytes, in steps of this
_MARGIN = 64  # cells that a grid is made larger than needed, so that it need not grow with every scan
_MARKS = 254  # largest of the marks, two a scan, before they are used again


class GridBuilder:
    """Takes scans with their poses one by one. Later scans outvote earlier ones: what has left does not stay."""

    def __init__(self, settings: GridSettings | None = None) -> None:
        self.settings = settings or GridSettings()
        self.clear()

    def clear(self) -> None:
        """Forget everything, to begin anew with other poses."""
        self._low = np.zeros(2, np.int64)  # column and row of the first cell, counted from the world's origin
        self._odds = np.zeros((0, 0), np.int8)
        self._marks = np.zeros((0, 0), np.uint8)
        self._mark = -1

    def add(self, scan: Scan, pose: Array) -> None:
        """Add a scan taken at a pose (3,), T_world_sensor. Beams without return say nothing.

        Raises GridError if the pose is not finite or the grid would have too many cells; it is as before then.
        """
        if np.shape(pose) != (3,) or not np.isfinite(pose).all():
            raise GridError(f"The pose is {pose}: give x (m), y (m) and heading (rad), all finite.")
        known = scan.valid & (scan.ranges <= self.settings.max_range)
        ranges, angles = scan.ranges[known], scan.bearings[known] + pose[2]
        start = np.asarray(pose[:2], np.float64) / self.settings.resolution
        ends = start + unit_vectors(angles) * (ranges / self.settings.resolution)[:, None]
        self._make_room(np.vstack([ends, start]))
        self._next_mark()
        ends, start = ends - self._low, start - self._low
        mark_scan(self._odds, self._marks, self._mark, ends, start, self._evidence)

    def grid(self) -> OccupancyGrid:
        """The grid as it is now, just large enough. Raises GridError if no scan with a return was added."""
        seen = self._odds != 0
        rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
        if not len(rows):
            raise GridError(
                f"The grid is empty: no scan has a return within {self.settings.max_range:g} m. "
                "Check that ranges are in metres; `lidarcore info` shows them."
            )
        part = self._odds[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        cells = np.where(part > 0, OCCUPIED, np.where(part < 0, FREE, UNKNOWN)).astype(np.int8)
        corner = (self._low + np.array([columns[0], rows[0]])) * self.settings.resolution
        return OccupancyGrid(cells, self.settings.resolution, np.array([*corner, 0.0]))

    @property
    def _evidence(self) -> Evidence:
        s = self.settings
        odds = (s.hit, s.miss, s.miss_beside_hit, s.most, s.least)
        hit, miss, little, most, least = (max(1, round(value / _STEP)) for value in odds)
        return hit, miss, little, most, -least

    def _make_room(self, points: Array) -> None:
        """Grow, if need be, to hold points (N, 2) in cells."""
        low = np.floor(points.min(axis=0)).astype(np.int64)
        high = np.floor(points.max(axis=0)).astype(np.int64) + 1
        before_low, before_high = self._low, self._low + self._odds.shape[::-1]
        if self._odds.size:
            if (low >= before_low).all() and (high <= before_high).all():
                return
            low = np.where(low < before_low, low - _MARGIN, before_low)
            high = np.where(high > before_high, high + _MARGIN, before_high)
        width, height = high - low
        if int(width) * int(height) > self.settings.most_cells:
            raise GridError(
                f"The grid would have {width} x {height} cells of {self.settings.resolution:g} m, more than "
                f"{self.settings.most_cells}: use larger cells, or a smaller max_range if stray returns are the cause."
            )
        self._odds = _moved(self._odds, low - before_low, (height, width))
        self._marks = _moved(self._marks, low - before_low, (height, width))
        self._low = low

    def _next_mark(self) -> None:
        self._mark += 2
        if self._mark > _MARKS:
            self._marks[:] = 0
            self._mark = 1


def build_grid(scans: Iterable[Scan], poses: Array, settings: GridSettings | None = None) -> OccupancyGrid:
    """The grid of scans in the order they were taken at poses (K, 3), T_world_sensor. Raises GridError."""
    builder = GridBuilder(settings)
    for scan, pose in zip(scans, poses, strict=True):
        builder.add(scan, pose)
    return builder.grid()


def _moved(table: "np.ndarray", shift: Ints, shape: tuple[int, int]) -> "np.ndarray":
    """A table of another shape that holds this one, whose first cell is at minus the shift (column, row)."""
    larger = np.zeros(shape, table.dtype)
    column, row = -shift if table.size else (0, 0)
    larger[row : row + table.shape[0], column : column + table.shape[1]] = table
    return larger
