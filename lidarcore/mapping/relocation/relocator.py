"""The pose in a known map: the algorithm on one screen."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import compose
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.relocation.field import FULL, make_field
from lidarcore.mapping.relocation.query import Query
from lidarcore.mapping.relocation.refine import refined
from lidarcore.mapping.relocation.search import best_pose, contradicted, top_nodes
from lidarcore.mapping.relocation.settings import RelocationSettings

Verdict = Literal["found", "too few points", "no fit", "several places"]

_APART = (0.8, 0.35)  # m, rad: poses closer than both are one place
_TRIES = 12  # rivals that are contradicted, after which the rest is taken for one that is not
_SKIP = 0.4  # m before a ray's end in which something occupied is what it hit


@dataclass(frozen=True, slots=True, eq=False)
class Relocation:
    """What came of looking for a pose.

    verdict     "found", or why it is not believed
    pose        (3,) T_world_sensor of the best fit, NaN if there is none
    covariance  (3, 3) of the pose
    fit         0 to 1: how well the points lie on what stands
    against     share of the rays that the map contradicts
    rival       fit of the best other place that is not contradicted, 0 if it is below what counts
    """

    verdict: Verdict
    pose: Array
    covariance: Array
    fit: float
    against: float
    rival: float

    @property
    def found(self) -> bool:
        """True if the pose can be believed."""
        return self.verdict == "found"


class Relocator:
    """Finds poses in one map. Making it takes a moment; it may be asked from several threads.

    Raises LocalizationError if the map has nothing to go by or is too large.
    """

    def __init__(self, grid: OccupancyGrid, settings: RelocationSettings | None = None) -> None:
        self.settings = settings or RelocationSettings()
        self._grid, self._field = grid, make_field(grid, self.settings.reach)

    def find(self, query: Query) -> Relocation:
        """Where the last scan of a query was taken."""
        s, points = self.settings, query.points / self._grid.resolution
        if len(points) < s.least_points:
            return _nowhere("too few points")
        angles = self._angles(points)
        columns, rows = _turned(points, angles)
        field, full = self._field, FULL * len(points)
        least = int(s.fit * full)
        nodes, bounds = top_nodes(field.levels, field.room, columns, rows, int(s.rival * least))
        order = np.argsort(-bounds, kind="stable")
        apart = int(_APART[1] / (angles[1] - angles[0])), int(_APART[0] / self._grid.resolution)
        taken = np.empty((0, 3), np.int32)
        best = None
        threshold = least
        for _ in range(_TRIES):
            fit, *place = best_pose(
                field.levels, field.room, columns, rows, nodes, bounds, order, threshold, taken, apart
            )
            if fit < 0:
                break
            pose = self._pose(angles, place)
            against = self._against(query, pose)
            taken = np.vstack([taken, np.array([place], np.int32)])
            if against > s.against:
                continue
            if best is None:
                best, threshold = (fit / full, against, pose), int(s.rival * fit)
            else:
                return self._relocation(query, *best, rival=fit / full)
        return _nowhere("no fit") if best is None else self._relocation(query, *best, rival=0.0)

    def _relocation(self, query: Query, fit: float, against: float, pose: Array, rival: float) -> Relocation:
        pose, covariance = refined(self._field, query.points / self._grid.resolution, pose)
        verdict: Verdict = "several places" if rival > 0 else "found"
        if fit - against < self.settings.fit:
            verdict = "no fit"
        return Relocation(verdict, *self._in_world(pose, covariance), fit, against, rival)

    def _angles(self, points: Array) -> Array:
        """Headings at steps by which the farther points move about as far as they may lie beside the map."""
        far = float(np.quantile(np.hypot(*points.T), 0.8))
        step = 1.2 * self.settings.reach / self._grid.resolution / max(far, 20.0)
        return np.linspace(-np.pi, np.pi, int(np.ceil(2 * np.pi / step)), endpoint=False)

    def _pose(self, angles: Array, place: list[int]) -> Array:
        """(3,) in cells of the field: the middle of the cell."""
        return np.array([place[1] + 0.5, place[2] + 0.5, angles[place[0]]])

    def _against(self, query: Query, pose: Array) -> float:
        c, s = np.cos(pose[2]), np.sin(pose[2])
        turn = np.array([[c, s], [-s, c]]) / self._grid.resolution
        points, origins = query.points @ turn + pose[:2], query.origins @ turn + pose[:2]
        return float(contradicted(self._field.states, points, origins, _SKIP / self._grid.resolution))

    def _in_world(self, pose: Array, covariance: Array) -> tuple[Array, Array]:
        """A pose in cells of the field and its covariance, in metres of the world."""
        cell = self._grid.resolution
        in_grid = np.array([*((pose[:2] + self._field.corner) * cell), pose[2]])
        c, s = np.cos(self._grid.origin[2]), np.sin(self._grid.origin[2])
        J = np.array([[c * cell, -s * cell, 0], [s * cell, c * cell, 0], [0, 0, 1]])
        return compose(self._grid.origin, in_grid), J @ covariance @ J.T


def _turned(points: Array, angles: Array) -> tuple["np.ndarray", "np.ndarray"]:
    """Columns and rows (A, N) of points at headings, from the middle of the sensor's cell."""
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    x, y = c * points[:, 0] - s * points[:, 1], s * points[:, 0] + c * points[:, 1]
    return np.floor(x + 0.5).astype(np.int32), np.floor(y + 0.5).astype(np.int32)


def _nowhere(verdict: Verdict) -> Relocation:
    return Relocation(verdict, np.full(3, np.nan), np.full((3, 3), np.nan), 0.0, 0.0, 0.0)
