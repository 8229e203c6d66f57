"""What a map can be asked: landmarks in a region page by page, and those nearest to a point.

The R*Tree finds candidates by their rounded places, the table of landmarks decides.
"""

import math
import sqlite3
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from lidarcore.errors import LandmarkError
from lidarcore.landmarks.landmark import COLUMNS, Landmark, as_integer, as_number

Parameters = dict[str, Any]
Clauses = tuple[str, Parameters]  # SQL, and the values of its names

MOST = 10_000  # landmarks in one answer
_MANY = 5_000  # a region that holds more is read from the table in the order of ids
SELECTED = ", ".join(f"landmarks.{name}" for name in COLUMNS)
IN_BOX = (
    "x_max >= :x0 AND x_min <= :x1 AND y_max >= :y0 AND y_min <= :y1 "
    "AND session_max >= :session AND session_min <= :session"
)


@dataclass(frozen=True, slots=True)
class Box:
    """An axis-parallel rectangle in the frame of the map, m; the edges belong to it.

    Raises LandmarkError if a bound is NaN or a minimum is above its maximum.
    """

    x_min: float
    y_min: float
    x_max: float
    y_max: float

    def __post_init__(self) -> None:
        check_order("x_min", self.x_min, "x_max", self.x_max)
        check_order("y_min", self.y_min, "y_max", self.y_max)

    @property
    def bounds(self) -> "Box":
        """Itself."""
        return self

    @property
    def parameters(self) -> Parameters:
        """The bounds by the names that IN_BOX has."""
        return {"x0": self.x_min, "x1": self.x_max, "y0": self.y_min, "y1": self.y_max}

    def exactly(self) -> Clauses:
        """The condition on a landmark's x and y."""
        return "landmarks.x BETWEEN :x0 AND :x1 AND landmarks.y BETWEEN :y0 AND :y1", self.parameters


@dataclass(frozen=True, slots=True)
class Circle:
    """All points within a radius (m) of a point, in the frame of the map.

    Raises LandmarkError if a number is not finite or the radius is negative.
    """

    x: float
    y: float
    radius: float

    def __post_init__(self) -> None:
        check_finite(x=self.x, y=self.y, radius=self.radius)
        check_order("0", 0.0, "radius", self.radius)

    @property
    def bounds(self) -> Box:
        """The square around it."""
        r = self.radius
        return Box(self.x - r, self.y - r, self.x + r, self.y + r)

    def exactly(self) -> Clauses:
        """The condition on a landmark's x and y."""
        clause = f"{SQUARED_DISTANCE} <= :r * :r"
        return clause, {"cx": self.x, "cy": self.y, "r": self.radius}


SQUARED_DISTANCE = "((landmarks.x - :cx) * (landmarks.x - :cx) + (landmarks.y - :cy) * (landmarks.y - :cy))"


@dataclass(frozen=True, slots=True, kw_only=True)
class Filter:
    """Which landmarks count. As it is, all.

    kinds, methods            one of these; empty for any
    seen_from, seen_to        s, seen at some time between: last_seen >= seen_from and first_seen <= seen_to
    min_count                 seen at least so often
    max_sigma                 m, standard deviation along the longest axis of the ellipse

    Raises LandmarkError if a bound is NaN or seen_from is after seen_to.
    """

    kinds: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    seen_from: float = -math.inf
    seen_to: float = math.inf
    min_count: int = 1
    max_sigma: float = math.inf

    def __post_init__(self) -> None:
        check_order("seen_from", self.seen_from, "seen_to", self.seen_to)
        check_order("0", 0.0, "max_sigma", self.max_sigma)
        as_integer(self.min_count, "min_count")
        if isinstance(self.kinds, str) or isinstance(self.methods, str):
            raise LandmarkError(f"kinds is {self.kinds!r}, methods {self.methods!r}: give tuples of names.")

    def clauses(self) -> Clauses:
        """The conditions that are set."""
        found: dict[str, Parameters] = {}
        for column, names in (("kind", self.kinds), ("method", self.methods)):
            if names:
                values = {f"{column}{i}": name for i, name in enumerate(names)}
                found[f"landmarks.{column} IN ({', '.join(f':{name}' for name in values)})"] = values
        for clause, name, value, idle in (
            ("landmarks.last_seen >= :seen_from", "seen_from", self.seen_from, -math.inf),
            ("landmarks.first_seen <= :seen_to", "seen_to", self.seen_to, math.inf),
            ("landmarks.count >= :min_count", "min_count", self.min_count, 1),
            ("landmarks.sigma <= :max_sigma", "max_sigma", self.max_sigma, math.inf),
        ):
            if value != idle:
                found[clause] = {name: value}
        return joined(found.items())


@dataclass(frozen=True, slots=True)
class Page:
    """Landmarks in the order of their ids; `next` is what to give as `after` for the next page, None at the end."""

    landmarks: list[Landmark]
    next: int | None


def find(
    connection: sqlite3.Connection,
    session: int,
    region: Box | Circle | None,
    filter_: Filter,
    after: int,
    limit: int,
) -> Page:
    """Landmarks of a session in the region (None: anywhere) with ids above `after`, at most `limit`."""
    check_limit("limit", limit)
    as_integer(after, "after")
    conditions, of_session = (
        [filter_.clauses(), ("landmarks.id > :after", {"after": after})],
        "landmarks.session",
    )
    if region is not None:
        conditions.append(region.exactly())
        if _count(connection, session, region.bounds, _MANY) < _MANY:
            inside = f"landmarks.id IN (SELECT id FROM places WHERE {IN_BOX} AND id > :after)"
            conditions.append((inside, region.bounds.parameters))
            of_session = "+landmarks.session"  # the + keeps SQLite from walking through the whole session
    conditions.append((f"{of_session} = :session", {"session": session}))
    where, parameters = joined(conditions)
    rows = connection.execute(
        f"SELECT {SELECTED} FROM landmarks WHERE {where} ORDER BY landmarks.id LIMIT :limit",
        parameters | {"limit": limit + 1},
    ).fetchall()
    landmarks = [Landmark(*row) for row in rows[:limit]]
    return Page(landmarks, landmarks[-1].id if len(rows) > limit else None)


def _count(connection: sqlite3.Connection, session: int, box: Box, most: int) -> int:
    """How many landmarks there are about the box, counted up to `most`."""
    query = f"SELECT count(*) FROM (SELECT 1 FROM places WHERE {IN_BOX} LIMIT :most)"
    parameters = box.parameters | {"session": session, "most": most}
    return int(connection.execute(query, parameters).fetchone()[0])


def joined(conditions: Iterable[Clauses]) -> Clauses:
    """Conditions joined by AND to one."""
    given = list(conditions)
    parameters = {name: value for _, values in given for name, value in values.items()}
    return " AND ".join(clause for clause, _ in given if clause), parameters


def check_finite(**numbers: float) -> None:
    """Raises LandmarkError for NaN, infinity and what is no number."""
    for name, value in numbers.items():
        if not math.isfinite(as_number(value, name)):
            raise LandmarkError(f"{name} is {value}: give a finite number.")


def check_limit(name: str, value: int) -> None:
    """Raises LandmarkError unless the value is a possible number of landmarks in an answer."""
    if not 1 <= as_integer(value, name) <= MOST:
        raise LandmarkError(f"{name} is {value}: ask for 1 to {MOST} landmarks.")


def check_order(low_name: str, low: float, high_name: str, high: float) -> None:
    """Raises LandmarkError unless low <= high; so also for NaN."""
    if not as_number(low, low_name) <= as_number(high, high_name):
        raise LandmarkError(
            f"{low_name} = {low} is not below {high_name} = {high}: exchange or correct them."
        )
