"""The k landmarks nearest to a point, by Euclidean or Mahalanobis distance, exactly."""

import heapq
import math
import sqlite3
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from lidarcore.geometry import largest_variance
from lidarcore.landmarks.landmark import Landmark
from lidarcore.landmarks.queries import IN_BOX, SELECTED, SQUARED_DISTANCE, Box, Filter, joined

Metric = Literal["euclidean", "mahalanobis"]
Covariance = tuple[float, float, float]  # var_x, cov_xy, var_y, m²

_START, _LEAST = 1.0, 1e-3  # m, half-widths of the squares looked into: the first, and the smallest
_BAND = 4.0  # landmarks are looked for by classes of sigma, each up to this many times the one below
_FEW = 1000  # landmarks
_ROUNDING = 1 + 1e-9

_DX, _DY = "(landmarks.x - :cx)", "(landmarks.y - :cy)"
_XX, _XY, _YY = "(landmarks.var_x + :r_xx)", "(landmarks.cov_xy + :r_xy)", "(landmarks.var_y + :r_yy)"
_QUADRATIC = f"{_YY} * {_DX} * {_DX} - 2 * {_XY} * {_DX} * {_DY} + {_XX} * {_DY} * {_DY}"
_SQUARED: dict[Metric, str] = {
    "euclidean": SQUARED_DISTANCE,
    "mahalanobis": f"(({_QUADRATIC}) / ({_XX} * {_YY} - {_XY} * {_XY}))",
}
_ORDER = "squared <= :within * :within ORDER BY squared, landmarks.id"


@dataclass(frozen=True, slots=True)
class Neighbour:
    """A landmark and its distance: m (Euclidean), or without unit (Mahalanobis)."""

    landmark: Landmark
    distance: float


class Neighbourhood:
    """What is about a point (m) of a certain covariance (m²) in a session, of the landmarks that pass the filter."""

    def __init__(
        self,
        connection: sqlite3.Connection,
        session: int,
        xy: tuple[float, float],
        covariance: Covariance,
        which: Filter,
    ) -> None:
        self._connection = connection
        self._xy = xy
        r_xx, r_xy, r_yy = covariance
        self._variance = float(largest_variance(np.array([[r_xx, r_xy], [r_xy, r_yy]])))
        of_session = ("landmarks.session = :session", {"session": session})
        self._filter, parameters = joined([of_session, which.clauses()])
        names = ("cx", "cy", "r_xx", "r_xy", "r_yy")
        self._parameters = parameters | dict(zip(names, (*xy, *covariance), strict=True))
        query = "SELECT * FROM extents WHERE session = ?"
        extent = connection.execute(query, (session,)).fetchone() or (session, *6 * (0.0,))
        self._bounds, self._sigmas, self._max_sigma = extent[1:5], extent[5:], which.max_sigma

    def nearest(self, k: int, within: float, metric: Metric) -> list[Neighbour]:
        """The k nearest, at most `within` away, nearest first."""
        if self._are_few():
            return self._nearest_of_all(k, within, metric)
        if metric == "euclidean":
            return self._nearest(metric, k, within, self._reach(k, within), 0.0)
        return self._mahalanobis(k, within)

    def _mahalanobis(self, k: int, within: float) -> list[Neighbour]:
        """The k nearest by sqrt(d^T (C + R)^-1 d), C of the landmark, R of the point, at most `within` away.

        A landmark of standard deviation s within D is also within D sqrt(s² + largest variance of R) metres: a
        different square for each class of s. D is doubled until it holds k.
        """
        bands, radius = self._bands(), min(1.0, within)
        while True:
            reach = [_ROUNDING * radius * math.sqrt(s * s + self._variance) for s in bands]
            everywhere = min(reach) >= self._farthest()
            found = self._merged(k, within if everywhere else radius, reach, bands)
            if len(found) == k or everywhere or radius == within:
                return found
            radius = min(2 * radius, within)

    def _are_few(self) -> bool:
        """True if so few landmarks pass the filter that looking at each is quickest."""
        query = f"SELECT count(*) FROM (SELECT 1 FROM landmarks WHERE {self._filter} LIMIT {_FEW})"
        return int(self._connection.execute(query, self._parameters).fetchone()[0]) < _FEW

    def _nearest_of_all(self, k: int, within: float, metric: Metric) -> list[Neighbour]:
        """Without the R*Tree."""
        where = f"{self._filter} AND {_ORDER} LIMIT {k}"
        query = f"SELECT {SELECTED}, {_SQUARED[metric]} AS squared FROM landmarks WHERE {where}"
        return _neighbours(self._connection.execute(query, self._parameters | {"within": within}))

    def _merged(self, k: int, within: float, reach: list[float], bands: list[float]) -> list[Neighbour]:
        """The k nearest by Mahalanobis distance of each class's square."""
        found = {
            neighbour.landmark.id: neighbour
            for r, s in zip(reach, bands, strict=True)
            for neighbour in self._nearest("mahalanobis", k, within, r, s / _BAND)
        }
        return heapq.nsmallest(k, found.values(), key=_rank)

    def _reach(self, k: int, within: float) -> float:
        """Half-width (m) of a square that holds the k nearest in metres, or all within, and not many more."""

        def holds(width: float) -> bool:
            return len(self._rows("1", width, 0.0, f"LIMIT {k}", {})) >= k

        width, farthest = _START, min(within, self._farthest())
        while width < farthest and not holds(width):
            width *= 2
        while width > _LEAST and holds(width / 2):
            width /= 2
        return min(width * math.sqrt(2), within)

    def _nearest(self, metric: Metric, k: int, within: float, width: float, sigma: float) -> list[Neighbour]:
        """The k nearest in the square of this half-width (m)."""
        columns, order = f"{SELECTED}, {_SQUARED[metric]} AS squared", f"AND {_ORDER} LIMIT {k}"
        return _neighbours(self._rows(columns, width, sigma, order, {"within": within}))

    def _rows(
        self, columns: str, width: float, sigma: float, rest: str, parameters: dict[str, float]
    ) -> list[tuple[Any, ...]]:
        """Rows of the landmarks about the square of this half-width (m) that may have this sigma or more."""
        x, y = self._xy
        square = Box(x - width, y - width, x + width, y + width)
        uncertain = ("sigma_max >= :sigma", {"sigma": sigma})
        where, given = joined([(IN_BOX, square.parameters), uncertain, (self._filter, self._parameters)])
        query = f"SELECT {columns} FROM places CROSS JOIN landmarks USING (id) WHERE {where} {rest}"
        return self._connection.execute(query, given | parameters).fetchall()

    def _farthest(self) -> float:
        """How far (m) a landmark may be, along x or y."""
        (x, y), (x_min, x_max, y_min, y_max) = self._xy, self._bounds
        return max(x - x_min, x_max - x, y - y_min, y_max - y)

    def _bands(self) -> list[float]:
        """Upper bounds (m) of the classes of sigma of which landmarks may pass the filter."""
        least, most = self._sigmas
        bands = [least * _BAND]
        while bands[-1] < min(most, self._max_sigma):
            bands.append(bands[-1] * _BAND)
        return bands


def _neighbours(rows: Iterable[tuple[Any, ...]]) -> list[Neighbour]:
    return [Neighbour(Landmark(*row), math.sqrt(max(squared, 0.0))) for *row, squared in rows]


def _rank(neighbour: Neighbour) -> tuple[float, int]:
    return neighbour.distance, neighbour.landmark.id or 0
