"""The walls of a session in the file: as they are now, how they err together, and what each was in every second."""

import math
import sqlite3
from collections.abc import Iterable
from dataclasses import astuple, dataclass, fields

from lidarcore.landmarks.database import AT_ONCE, Database


@dataclass(frozen=True, slots=True)
class StoredWall:
    """A surface seen from one side, in the frame of its map: x cos(alpha) + y sin(alpha) = r, rad and m.

    id                                its own in the map, as the one who mapped gave it
    var_alpha, cov_alpha_r, var_r     covariance of the line: rad², rad m, m²
    x1, y1, x2, y2                    m, its ends; who looks from the first to the second has the free side on the left
    length, var_length                m, m²
    ended_1, ended_2                  0 at an end beyond which the wall may go on, for nobody looked there
    corner_1, corner_2                1 at an end that is a corner
    first_seen, last_seen             s
    count                             number of scans of the map that saw it
    """

    id: int
    alpha: float
    r: float
    var_alpha: float
    cov_alpha_r: float
    var_r: float
    x1: float
    y1: float
    x2: float
    y2: float
    length: float
    var_length: float
    ended_1: int
    ended_2: int
    corner_1: int
    corner_2: int
    first_seen: float
    last_seen: float
    count: int


_COLUMNS = tuple(one.name for one in fields(StoredWall))
_WALL = ", ".join(_COLUMNS)
_STATE = ", ".join(_COLUMNS[1:])  # all but the id
_VALUES = ", ".join("?" for _ in _COLUMNS)
_INSERT = f"INSERT INTO walls (session, {_WALL}) VALUES (?, {_VALUES})"
_REMEMBER = f"INSERT OR REPLACE INTO wall_history (session, second, wall, {_STATE}) VALUES (?, ?, {_VALUES})"


def replace_walls(
    connection: sqlite3.Connection, session: int, walls: Iterable[StoredWall], covariance: bytes | None
) -> None:
    """Store walls, and how they err together, in place of those there are; what differs of a wall is remembered."""
    before, now = set(walls_of(connection, session)), list(walls)
    connection.execute("DELETE FROM walls WHERE session = ?", (session,))
    connection.executemany(_INSERT, ((session, *astuple(one)) for one in now))
    changed = (one for one in now if one not in before)
    connection.executemany(
        _REMEMBER, ((session, math.floor(one.last_seen), *astuple(one)) for one in changed)
    )
    connection.execute("DELETE FROM wall_covariances WHERE session = ?", (session,))
    if covariance is not None:
        connection.execute("INSERT INTO wall_covariances VALUES (?, ?)", (session, covariance))


def walls_of(connection: sqlite3.Connection, session: int) -> list[StoredWall]:
    """The walls of a session in the order of their ids."""
    query = f"SELECT {_WALL} FROM walls WHERE session = ? ORDER BY id"
    return [StoredWall(*row) for row in connection.execute(query, (session,))]


def covariance_of(connection: sqlite3.Connection, session: int) -> bytes | None:
    """How the walls of a session err together, if that is kept."""
    query = "SELECT packed FROM wall_covariances WHERE session = ?"
    row = connection.execute(query, (session,)).fetchone()
    return None if row is None else row[0]


def wall_history(
    connection: sqlite3.Connection, session: int, id: int, after: float, limit: int
) -> list[StoredWall] | None:
    """At most so many states of a wall with last_seen > after (s), the oldest first; None if there never was one."""
    of_it, parameters = "FROM wall_history WHERE session = ? AND wall = ?", (session, id)
    if not connection.execute(f"SELECT 1 {of_it}", parameters).fetchone():
        return None
    query = f"SELECT wall, {_STATE} {of_it} AND last_seen > ? ORDER BY second LIMIT ?"
    return [StoredWall(*row) for row in connection.execute(query, (*parameters, after, limit))]


def forget_walls(database: Database, session: int) -> None:
    """Give up the history of a session's walls in transactions that are each short."""
    query = """DELETE FROM wall_history WHERE (session, wall, second) IN (
        SELECT session, wall, second FROM wall_history WHERE session = ? LIMIT ?)"""
    left = True
    while left:
        with database.writing() as connection:
            left = connection.execute(query, (session, AT_ONCE)).rowcount == AT_ONCE
