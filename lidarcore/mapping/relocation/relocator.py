"""The pose in a known map: the algorithm on one screen."""

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import UncertainPose, act, compose, largest_variance, relative, rotate, rotation, wrap
from lidarcore.mapping.doubt import evidence
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.relocation.field import FULL, LEVELS, make_field, searchable
from lidarcore.mapping.relocation.query import Query
from lidarcore.mapping.relocation.refine import refined
from lidarcore.mapping.relocation.search import Turned, best_pose, borne_out, contradicted, fit_at, squares
from lidarcore.mapping.relocation.settings import RelocationSettings

Verdict = Literal["found", "too few points", "no fit", "several places"]

_APART = (0.8, 0.35)  # m, rad: poses closer than both are one place
_MOST_PLACES = 12  # where the points fit, from which on nothing tells them apart
_SURE = 40.0  # log-likelihood ratio that the best of all wrong places reaches for one in 130 scans of another building
_BEYOND = 1e9  # cells; farther away is as far as that
_SIGMAS = 3.0  # of a guess, within which a pose is looked for
_NEAR_LEVEL = 3  # of the squares in which it is, at least


@dataclass(frozen=True, slots=True, eq=False)
class Relocation:
    """What came of looking for a pose.

    verdict     "found", or why it is not believed
    pose        (3,) T_world_sensor of the best fit, NaN if there is none
    covariance  (3, 3) of the pose
    fit         0 to 1: how well the points lie on what stands
    against     share of the rays that the map contradicts
    rival       fit of the best other place that may be the true one, 0 if there is none
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


class _Place(NamedTuple):
    """A pose (3,) in cells of the field at which the points fit.

    fit      how well they do
    worth    how well those do whose rays the map does not contradict
    against  share of the rays that it contradicts
    """

    fit: float
    worth: float
    against: float
    pose: Array


class Relocator:
    """Finds poses in one map. Making it takes a moment; it may be asked from several threads.

    Things may have been moved since the map was made: where it contradicts a ray, the point does not fit, and nothing
    more is held against the place.

    A map of more than some 200 m by 200 m in cells of 5 cm is searched in larger ones, and poses are known less well.

    Raises LocalizationError if the map has nothing to go by.
    """

    def __init__(self, grid: OccupancyGrid, settings: RelocationSettings | None = None) -> None:
        self.settings = settings or RelocationSettings()
        self._grid = searchable(grid)
        self._field = make_field(self._grid, self.settings.reach)

    def find(self, query: Query) -> Relocation:
        """Where the pose that a query looks for is."""
        if len(query.points) < self.settings.least_points:
            return _nowhere("too few points")
        height, width = self._field.room.shape[1:]
        angles = self._angles(query)
        found = self._best(query, angles, np.arange(len(angles)), LEVELS - 1, (0, 0, width, height))
        if found is not None and found.found and evidence(found.fit, len(query.points)) < _SURE:
            return replace(found, verdict="too few points")
        return found or _nowhere("no fit")

    def find_near(self, query: Query, guess: UncertainPose) -> Relocation:
        """Where the pose that a query looks for is, within three standard deviations of a guess T_world_sensor.

        If it is not found there, the answer says how well the guess itself fits. Only places near the guess are
        rivals.
        """
        if len(query.points) < self.settings.least_points:
            return _nowhere("too few points")
        angles, at = self._angles(query), self._in_field(guess.pose)
        turn = max(_SIGMAS * np.sqrt(guess.covariance[2, 2]), _APART[1])
        near = np.flatnonzero(np.abs(wrap(angles - at[2])) <= turn)
        spread = _SIGMAS * np.sqrt(float(largest_variance(guess.covariance[:2, :2])))
        away = max(spread, _SIGMAS * self.settings.reach) / self._grid.resolution
        ends = np.clip([at[:2] - away, at[:2] + away + 1], 0, self._field.room.shape[:0:-1])
        left, low, right, high = ends.astype(int).ravel().tolist()
        level = int(np.clip(np.log2(away) - 1, _NEAR_LEVEL, LEVELS - 1))
        box = left, low, right, high
        return self._best(query, angles, near, level, box) or self._as_guessed(query, at)

    def _best(
        self, query: Query, angles: Array, tried: Ints, level: int, box: tuple[int, int, int, int]
    ) -> Relocation | None:
        """The best pose at some of the angles in a box of cells, if the points fit at one."""
        s, field = self.settings, self._field
        points = _turned(query.points / self._grid.resolution, angles)
        full = FULL * len(query.points)
        threshold = int(s.fit * full)
        nodes = squares(field, points, level, tried, box, int(s.rival * threshold))
        apart = int(_APART[1] / (angles[1] - angles[0])), int(_APART[0] / self._grid.resolution)
        taken = np.empty((0, 3), np.int32)
        places: list[_Place] = []
        for _ in range(_MOST_PLACES):
            fit, *place = best_pose(field, points, nodes, threshold, taken, apart)
            if fit < 0:
                break
            pose = self._pose(angles, place)
            taken = np.vstack([taken, np.array([place], np.int32)])
            places.append(self._place(query, fit / full, pose))
            threshold = int(full * max(s.rival * _best_of(places).fit, s.fit))
        return self._judged(query, places) if places else None

    def _judged(self, query: Query, places: list[_Place]) -> Relocation:
        """The best of the places at which the points fit, and whether it stands alone."""
        s = self.settings
        best = _best_of(places)
        rivals = [
            other.fit
            for other in places
            if other is not best
            and other.fit >= s.rival * best.fit
            and other.against <= best.against + s.against
        ]
        verdict: Verdict = "found"
        if best.worth < s.fit:
            verdict = "no fit"
        elif rivals or len(places) == _MOST_PLACES:
            verdict = "several places"
        pose, covariance = refined(self._field, query.points / self._grid.resolution, best.pose)
        return Relocation(
            verdict, *self._in_world(pose, covariance), best.fit, best.against, max(rivals, default=0.0)
        )

    def _as_guessed(self, query: Query, at: Array) -> Relocation:
        """How well a pose (3,) in cells of the field fits, which is not found."""
        columns, rows = _turned(query.points / self._grid.resolution, at[2:])
        column, row = np.floor(np.clip(at[:2], -_BEYOND, _BEYOND)).astype(int).tolist()
        fit = fit_at(self._field.levels[0], columns[0], rows[0], column, row, 0) / FULL / len(query.points)
        return replace(_nowhere("no fit"), fit=fit, against=self._place(query, fit, at).against)

    def _angles(self, query: Query) -> Array:
        """Headings at steps by which the farther points move about as far as they may lie beside the map."""
        points = query.points / self._grid.resolution
        far = float(np.quantile(np.hypot(*points.T), 0.8))
        step = 1.2 * self.settings.reach / self._grid.resolution / max(far, 20.0)
        return np.linspace(-np.pi, np.pi, int(np.ceil(2 * np.pi / step)), endpoint=False)

    def _pose(self, angles: Array, place: list[int]) -> Array:
        """(3,) in cells of the field: the middle of the cell."""
        return np.array([place[1] + 0.5, place[2] + 0.5, angles[place[0]]])

    def _place(self, query: Query, fit: float, pose: Array) -> _Place:
        """A pose in cells of the field, and what speaks for and against it."""
        points, origins = (act(pose, xy / self._grid.resolution) for xy in (query.points, query.origins))
        worth = borne_out(self._field, points, origins)
        return _Place(fit, float(worth), float(contradicted(self._field.states, points, origins)), pose)

    def _in_field(self, pose: Array) -> Array:
        """A pose (3,) in the world in cells of the field."""
        x, y, heading = relative(self._grid.origin, pose)
        return np.array([*(np.array([x, y]) / self._grid.resolution - self._field.corner), heading])

    def _in_world(self, pose: Array, covariance: Array) -> tuple[Array, Array]:
        """A pose in cells of the field and its covariance, in metres of the world."""
        cell = self._grid.resolution
        in_grid = np.array([*((pose[:2] + self._field.corner) * cell), pose[2]])
        J = np.eye(3)
        J[:2, :2] = cell * rotation(self._grid.origin[2])
        return compose(self._grid.origin, in_grid), J @ covariance @ J.T


def _best_of(places: list[_Place]) -> _Place:
    return max(places, key=lambda place: place.worth)


def _turned(points: Array, angles: Array) -> Turned:
    """The points at headings, from the middle of the sensor's cell."""
    x, y = np.moveaxis(rotate(angles[:, None], points), -1, 0)
    return Turned(np.floor(x + 0.5).astype(np.int32), np.floor(y + 0.5).astype(np.int32))


def _nowhere(verdict: Verdict) -> Relocation:
    return Relocation(verdict, np.full(3, np.nan), np.full((3, 3), np.nan), 0.0, 0.0, 0.0)
