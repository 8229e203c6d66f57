"""One landmark of a map, and what makes it a possible one."""

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array
from lidarcore.errors import LandmarkError
from lidarcore.geometry import largest_variance

MAX_COORDINATE = 1e7  # m; farther than across a continent is surely another unit
MAX_TIME = 1e12  # s; that many are surely another unit
MAX_ID = 2**63 - 1
_SINGULAR = 1e-12  # 1 - correlation² of a covariance that rounding cannot tell from a singular one


@dataclass(frozen=True, slots=True)
class Landmark:
    """A point that was seen again and again, in the frame of its map.

    x, y                  m
    var_x, cov_xy, var_y  m², covariance of the position
    kind, method          what it is ("corner", "cluster") and what found it ("ml", "dbscan"; may be empty)
    count                 how often it was seen
    first_seen, last_seen s
    id                    given by the map; None for one that is not in a map yet

    Raises LandmarkError if a number is not finite, the covariance is not positive definite, first_seen is after
    last_seen, a position is beyond 10,000 km or a time beyond 1e12 s.
    """

    x: float
    y: float
    var_x: float
    cov_xy: float
    var_y: float
    kind: str
    method: str = ""
    count: int = 1
    first_seen: float = 0.0
    last_seen: float = 0.0
    id: int | None = None

    def __post_init__(self) -> None:
        for name, kind, convert in _NUMBERS:
            # Most come from the database and are of the right type already.
            if type(value := getattr(self, name)) is not kind and (name, value) != ("id", None):
                object.__setattr__(self, name, convert(value, name))
        self._check()

    @classmethod
    def of(cls, xy: ArrayLike, covariance: ArrayLike, kind: str, **rest: Any) -> "Landmark":
        """A landmark from a position (2,) m and its covariance (2, 2) m²; `rest` are the other fields.

        Raises LandmarkError, also for other shapes and a covariance that is not symmetric.
        """
        return cls(*as_position(xy), *as_covariance(covariance), kind, **rest)

    @property
    def xy(self) -> Array:
        """(2,) m."""
        return np.array([self.x, self.y])

    @property
    def covariance(self) -> Array:
        """(2, 2) m²."""
        return np.array([[self.var_x, self.cov_xy], [self.cov_xy, self.var_y]])

    @property
    def sigma(self) -> float:
        """Standard deviation along the longest axis of the ellipse, m."""
        return math.sqrt(largest_variance(self.covariance))

    def _check(self) -> None:
        if not math.isfinite(self.x + self.y + self.first_seen + self.last_seen):
            raise LandmarkError(
                f"Position ({self.x}, {self.y}) m, seen {self.first_seen} to {self.last_seen} s: give finite numbers."
            )
        if max(abs(self.x), abs(self.y)) > MAX_COORDINATE:
            raise LandmarkError(f"The position ({self.x:g}, {self.y:g}) is too far away: give metres.")
        _check_entries(self.var_x, self.cov_xy, self.var_y)
        if max(abs(self.first_seen), abs(self.last_seen)) > MAX_TIME:
            raise LandmarkError(
                f"Seen {self.first_seen:g} to {self.last_seen:g} s is not a time: give seconds."
            )
        if self.first_seen > self.last_seen:
            raise LandmarkError(
                f"first_seen {self.first_seen} s is after last_seen {self.last_seen} s: swap them."
            )
        if self.count < 1:
            raise LandmarkError(f"count is {self.count}: a landmark was seen at least once.")
        if self.id is not None and not 0 < self.id <= MAX_ID:
            raise LandmarkError(f"id is {self.id}: ids are positive; leave it out for a new landmark.")
        if not (_is_text(self.kind) and self.kind and _is_text(self.method)):
            raise LandmarkError(
                f"kind is {self.kind!r}, method is {self.method!r}: give printable text, kind not empty."
            )


def _check_entries(var_x: float, cov_xy: float, var_y: float) -> None:
    """Raises LandmarkError unless these are a covariance that the map takes, m²: each of thousands that are read."""
    most = MAX_COORDINATE**2
    if not (0 < var_x <= most and 0 < var_y <= most and cov_xy**2 < (1 - _SINGULAR) * var_x * var_y):
        raise LandmarkError(
            f"The covariance [[{var_x:g}, {cov_xy:g}], [{cov_xy:g}, {var_y:g}]] m² is not positive definite: "
            "give variances above 0 and less than full correlation."
        )


def as_position(xy: ArrayLike) -> tuple[float, float]:
    """x and y of an array (2,); raises LandmarkError for anything else, its numbers may be any."""
    array = _as_array(xy, (2,), "A position")
    return float(array[0]), float(array[1])


def as_covariance(covariance: ArrayLike) -> tuple[float, float, float]:
    """var_x, cov_xy and var_y of a positive definite array (2, 2); raises LandmarkError for anything else."""
    c = _as_array(covariance, (2, 2), "A covariance")
    if abs(c[0, 1] - c[1, 0]) > 1e-9 * abs(c).max():
        raise LandmarkError(f"The covariance {c.tolist()} m² is not symmetric.")
    triple = float(c[0, 0]), float(c[0, 1] + c[1, 0]) / 2, float(c[1, 1])
    _check_entries(*triple)
    return triple


def as_number(value: Any, name: str) -> float:
    """A float of a real number of any type; raises LandmarkError for anything else."""
    if isinstance(value, int | float | np.number) and not isinstance(value, bool | np.complexfloating):
        try:
            return float(value)
        except OverflowError:
            pass
    raise LandmarkError(f"{name} is {value!r}: give a number.")


def as_integer(value: Any, name: str) -> int:
    """An int of an integer of any type; raises LandmarkError for anything else."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        return int(value)
    raise LandmarkError(f"{name} is {value!r}: give an integer.")


def _as_array(values: ArrayLike, shape: tuple[int, ...], name: str) -> Array:
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise LandmarkError(f"{name} is not made of numbers: {error}.") from error
    if array.shape != shape:
        raise LandmarkError(f"{name} has shape {array.shape}: give {shape}.")
    return array


def _is_text(value: object) -> bool:
    return isinstance(value, str) and value.isprintable()


_FLOATS = ("x", "y", "var_x", "cov_xy", "var_y", "first_seen", "last_seen")
_NUMBERS = [(name, float, as_number) for name in _FLOATS] + [
    (name, int, as_integer) for name in ("count", "id")
]
COLUMNS = tuple(field.name for field in fields(Landmark))
"""A landmark's fields, in the order of its parameters."""

Row = dict[str, Any]
"""A landmark's fields by their names, unchecked."""
