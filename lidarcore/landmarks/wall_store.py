"""The walls of a session in the file: as they are now, and each as it was in every second in which it was seen."""

import math
import sqlite3
from collections.abc import Iterable
from dataclasses import astuple

from lidarcore.landmarks.database import AT_ONCE, Database
from lidarcore.landmarks.wall import COLUMNS, StoredWall

_WALL = ", ".join(COLUMNS)
_STATE = ", ".join(COLUMNS[1:])  # all but the id
_VALUES = ", ".join("?" for _ in COLUMNS)
_INSERT = f"INSERT INTO walls (session, {_WALL}) VALUES (?, {_VALUES})"
_REMEMBER = f"INSERT OR REPLACE INTO wall_history (session, second, wall, {_STATE}) VALUES (?, ?, {_VALUES})"


def replace_walls(connection: sqlite3.Connection, session: int, walls: Iterable[StoredWall]) -> None:
    """Store walls in place of those there are; what differs of a wall is remembered."""
    before, now = set(walls_of(connection, session)), list(walls)
    connection.execute("DELETE FROM walls WHERE session = ?", (session,))
    connection.executemany(_INSERT, ((session, *astuple(one)) for one in now))
    changed = (one for one in now if one not in before)
    connection.executemany(
        _REMEMBER, ((session, math.floor(one.last_seen), *astuple(one)) for one in changed)
    )


def walls_of(connection: sqlite3.Connection, session: int) -> list[StoredWall]:
    """The walls of a session in the order of their ids."""
    query = f"SELECT {_WALL} FROM walls WHERE session = ? ORDER BY id"
    return [StoredWall(*row) for row in connection.execute(query, (session,))]


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
