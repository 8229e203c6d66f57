"""The landmarks of a session in the file: as they are now, and each as it was in every second in which it was seen."""

import math
import sqlite3
from collections.abc import Iterable

from lidarcore.errors import UnknownLandmarkError
from lidarcore.landmarks.database import AT_ONCE, Database
from lidarcore.landmarks.landmark import COLUMNS, Landmark

_STATE = ", ".join(COLUMNS[:-1])  # all but the id
_VALUES = ", ".join(f":{name}" for name in COLUMNS[:-1])
_INSERT = f"INSERT INTO landmarks ({_STATE}, id, session, sigma) VALUES ({_VALUES}, NULL, :session, :sigma)"
_UPDATE = (
    f"UPDATE landmarks SET ({_STATE}, sigma) = ({_VALUES}, :sigma) WHERE id = :id AND session = :session"
)
_PLACE = "INSERT OR REPLACE INTO places VALUES (:id, :x, :x, :y, :y, 0, :sigma, :session, :session + 0.5)"
_REMEMBER = (
    f"INSERT OR REPLACE INTO history ({_STATE}, landmark, second, session) "
    f"VALUES ({_VALUES}, :id, :second, :session)"
)
_WIDEN = (
    "INSERT INTO extents VALUES (:session, :x, :x, :y, :y, :sigma, :sigma) ON CONFLICT DO UPDATE SET "
    + ", ".join(
        f"{name}_{least} = {least}({name}_{least}, :{name})"
        for name in ("x", "y", "sigma")
        for least in ("min", "max")
    )
)


def store_landmarks(connection: sqlite3.Connection, session: int, landmarks: Iterable[Landmark]) -> list[int]:
    """Store new landmarks (id None) and new states of known ones; their ids. Raises UnknownLandmarkError."""
    return [_store(connection, session, landmark) for landmark in landmarks]


def _store(connection: sqlite3.Connection, session: int, landmark: Landmark) -> int:
    values = {name: getattr(landmark, name) for name in COLUMNS} | {"session": session}
    values |= {"sigma": landmark.sigma, "second": math.floor(landmark.last_seen)}
    if landmark.id is None:
        values["id"] = connection.execute(_INSERT, values).lastrowid
    elif not connection.execute(_UPDATE, values).rowcount:
        raise unknown_landmark(session, landmark.id)
    for statement in (_PLACE, _WIDEN, _REMEMBER):
        connection.execute(statement, values)
    return int(values["id"])


def remove_landmark(connection: sqlite3.Connection, session: int, id: int) -> None:
    """Take a landmark out; its history stays. Raises UnknownLandmarkError."""
    query = "DELETE FROM landmarks WHERE id = ? AND session = ?"
    if not connection.execute(query, (id, session)).rowcount:
        raise unknown_landmark(session, id)
    connection.execute("DELETE FROM places WHERE id = ?", (id,))


def landmark_history(
    connection: sqlite3.Connection, session: int, id: int, after: float, limit: int
) -> list[Landmark]:
    """At most so many states of a landmark with last_seen > after (s), oldest first. Raises UnknownLandmarkError."""
    of_it, parameters = "FROM history WHERE landmark = ? AND session = ?", (id, session)
    if not connection.execute(f"SELECT 1 {of_it}", parameters).fetchone():
        raise unknown_landmark(session, id)
    query = f"SELECT {_STATE}, landmark {of_it} AND last_seen > ? ORDER BY second LIMIT ?"
    return [Landmark(*row) for row in connection.execute(query, (*parameters, after, limit))]


def forget_landmarks(database: Database, session: int) -> None:
    """Give up all landmarks of a session and their history in transactions that are each short."""
    while not _forget_some(database, session):
        pass


def _forget_some(database: Database, session: int) -> bool:
    """True if nothing was left."""
    some = f"WHERE session = {session} LIMIT {AT_ONCE}"
    with database.writing() as connection:
        connection.execute(f"DELETE FROM places WHERE id IN (SELECT id FROM landmarks {some})")
        landmarks = connection.execute(f"DELETE FROM landmarks WHERE id IN (SELECT id FROM landmarks {some})")
        states = connection.execute(
            f"DELETE FROM history WHERE (landmark, second) IN (SELECT landmark, second FROM history {some})"
        )
        if max(landmarks.rowcount, states.rowcount) == AT_ONCE:
            return False
        connection.execute("DELETE FROM extents WHERE session = ?", (session,))
        return True


def unknown_landmark(session: int, id: int) -> UnknownLandmarkError:
    """The error that a session holds no such landmark."""
    return UnknownLandmarkError(f"Session {session} holds no landmark {id}.")
