"""The map of landmarks on disk: what is in it, who put it there, and what it can be asked."""

import math
import sqlite3
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from numpy.typing import ArrayLike

from lidarcore.errors import LandmarkError, LandmarkMapError, UnknownLandmarkError
from lidarcore.landmarks.database import Database, path_of
from lidarcore.landmarks.landmark import COLUMNS, Landmark, as_covariance, as_position
from lidarcore.landmarks.nearest import Metric, Neighbour, Neighbourhood
from lidarcore.landmarks.queries import (
    Box,
    Circle,
    Filter,
    Page,
    check_finite,
    check_limit,
    check_order,
    find,
)

_ALL = Filter()
_STATE = ", ".join(COLUMNS[:-1])  # all but the id
_VALUES = ", ".join(f":{name}" for name in COLUMNS[:-1])
_INSERT = f"INSERT INTO landmarks ({_STATE}, id, sigma) VALUES ({_VALUES}, :id, :sigma)"
_UPDATE = f"UPDATE landmarks SET ({_STATE}, sigma) = ({_VALUES}, :sigma) WHERE id = :id"
_PLACE = "INSERT OR REPLACE INTO places VALUES (:id, :x, :x, :y, :y, 0, :sigma)"
_REMEMBER = (
    f"INSERT OR REPLACE INTO history ({_STATE}, landmark, second, session) "
    f"VALUES ({_VALUES}, :id, :second, :session)"
)
_WIDEN = "UPDATE extent SET " + ", ".join(
    f"{name}_{least} = {least}(ifnull({name}_{least}, :{name}), :{name})"
    for name in ("x", "y", "sigma")
    for least in ("min", "max")
)
_FORGET = (
    "DELETE FROM landmarks",
    "DELETE FROM places",
    "DELETE FROM history",
    "UPDATE extent SET (x_min, x_max, y_min, y_max, sigma_min, sigma_max) = (NULL, NULL, NULL, NULL, NULL, NULL)",
)


@dataclass(frozen=True, slots=True)
class Session:
    """One run that wrote into a map; times in s, `ended` None while it runs or if it was killed."""

    id: int
    source: str
    started: float
    ended: float | None


@dataclass(frozen=True, slots=True)
class State:
    """What a landmark was, and the session that wrote it, if it was told."""

    landmark: Landmark
    session: int | None


class LandmarkMap:
    """Landmarks in one file, in metres in the frame of the map; made if it is not there.

    Any number of threads and processes may use it, each thread through the same object; reading does not wait for
    writing. What `put` was given is on the disk when it returns. History keeps the last state of a landmark within
    each second of its last_seen.

    Raises LandmarkMapError if the file cannot be used: no map, another version or unit, damaged, locked, disk full.
    """

    def __init__(self, url: str | Path) -> None:
        """Open a path or sqlite:///path."""
        self._database = Database(path_of(url))
        self.path = self._database.path

    def __enter__(self) -> "LandmarkMap":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; no other call may be under way."""
        self._database.close()

    def __len__(self) -> int:
        with self._database.reading() as connection:
            return int(connection.execute("SELECT count(*) FROM landmarks").fetchone()[0])

    def __iter__(self) -> Iterator[Landmark]:
        """All landmarks in the order of their ids, as they were when the iteration began."""
        with self._database.reading() as connection:
            for row in connection.execute(f"SELECT {', '.join(COLUMNS)} FROM landmarks ORDER BY id"):
                yield Landmark(*row)

    def __getitem__(self, id: int) -> Landmark:
        """Raises UnknownLandmarkError."""
        with self._database.reading() as connection:
            query = f"SELECT {', '.join(COLUMNS)} FROM landmarks WHERE id = ?"
            if row := connection.execute(query, (id,)).fetchone():
                return Landmark(*row)
        raise _unknown(id)

    def put(self, landmarks: Iterable[Landmark], session: int | None = None) -> list[int]:
        """Store new landmarks (id None) and new states of known ones; their ids. All or none.

        Raises UnknownLandmarkError for an id that is not in the map, LandmarkMapError for an unknown session.
        """
        with self._database.writing() as connection:
            return _put(connection, landmarks, session)

    def remove(self, ids: Iterable[int]) -> None:
        """Take landmarks out, all or none; their history stays, their ids are not given again.

        Raises UnknownLandmarkError.
        """
        with self._database.writing() as connection:
            for id in ids:
                if not connection.execute("DELETE FROM landmarks WHERE id = ?", (id,)).rowcount:
                    raise _unknown(id)
                connection.execute("DELETE FROM places WHERE id = ?", (id,))

    def replace(self, landmarks: Iterable[Landmark], session: int | None = None) -> list[int]:
        """Give up all landmarks and their history for these, which keep the ids they have; all or none.

        Raises LandmarkMapError if an id comes twice, or for an unknown session.
        """
        with self._database.writing() as connection:
            for statement in _FORGET:
                connection.execute(statement)
            return _put(connection, landmarks, session, keep_ids=True)

    def clear(self) -> None:
        """Give up all landmarks and their history; sessions stay."""
        self.replace([])

    def find(
        self, region: Box | Circle | None = None, which: Filter = _ALL, after: int = 0, limit: int = 1000
    ) -> Page:
        """A page of at most `limit` landmarks in the region (None: anywhere), in the order of their ids.

        `after` is 0 for the first page, then the `next` of the page before. Raises LandmarkError.
        """
        with self._database.reading() as connection:
            return find(connection, region, which, after, limit)

    def nearest(
        self,
        xy: ArrayLike,
        k: int = 1,
        which: Filter = _ALL,
        within: float = math.inf,
        metric: Metric = "euclidean",
        covariance: ArrayLike | None = None,
    ) -> list[Neighbour]:
        """The k landmarks nearest to a point (2,) m, nearest first; those of equal distance by id.

        within      largest distance: m, or for Mahalanobis without unit, such as the root of a chi-square gate
        covariance  (2, 2) m² of the point, for Mahalanobis: the distance is sqrt(d^T (C + covariance)^-1 d) with
                    the landmark's C; None for an exact point

        Looks at every landmark of the map where few pass the filter, or far off the map; there `within` helps.
        Raises LandmarkError.
        """
        x, y = as_position(xy)
        check_finite(x=x, y=y)
        check_limit("k", k)
        check_order("0", 0.0, "within", within)
        if metric not in get_args(Metric) or (metric == "euclidean" and covariance is not None):
            raise LandmarkError(
                f"metric is {metric!r}: choose mahalanobis, or euclidean, which takes no covariance of the point."
            )
        point = (0.0, 0.0, 0.0) if covariance is None else as_covariance(covariance)
        with self._database.reading() as connection:
            return Neighbourhood(connection, (x, y), point, which).nearest(k, within, metric)

    def history(self, id: int, after: float = -math.inf, limit: int = 1000) -> list[State]:
        """States of one landmark with last_seen > after (s), oldest first, also of one that was removed.

        Raises UnknownLandmarkError.
        """
        check_limit("limit", limit)
        query = f"SELECT {_STATE}, landmark, session FROM history WHERE landmark = ? AND last_seen > ? ORDER BY second"
        with self._database.reading() as connection:
            if not connection.execute("SELECT 1 FROM history WHERE landmark = ?", (id,)).fetchone():
                raise _unknown(id)
            rows = connection.execute(f"{query} LIMIT ?", (id, after, limit)).fetchall()
        return [State(Landmark(*row), session) for *row, session in rows]

    def begin_session(self, source: str, started: float) -> int:
        """Note that a run begins to write, from a source, at a time (s); its id."""
        check_finite(started=started)
        with self._database.writing() as connection:
            query = "INSERT INTO sessions (source, started) VALUES (?, ?) RETURNING id"
            return int(connection.execute(query, (source, started)).fetchone()[0])

    def end_session(self, session: int, ended: float) -> None:
        """Note that a run has ended; raises LandmarkMapError for an unknown one or an end before its start."""
        check_finite(ended=ended)
        with self._database.writing() as connection:
            query = "UPDATE sessions SET ended = ?2 WHERE id = ?1 AND started <= ?2"
            if not connection.execute(query, (session, ended)).rowcount:
                raise LandmarkMapError(f"There is no session {session} that started before {ended} s.")

    def sessions(self) -> list[Session]:
        """All sessions, the oldest first."""
        with self._database.reading() as connection:
            rows = connection.execute(
                "SELECT id, source, started, ended FROM sessions ORDER BY id"
            ).fetchall()
        return [Session(*row) for row in rows]

    def extent(self) -> Box | None:
        """The smallest box around all landmarks, m; None for an empty map. Reads the whole map."""
        with self._database.reading() as connection:
            bounds = connection.execute("SELECT min(x), min(y), max(x), max(y) FROM landmarks").fetchone()
        return None if bounds[0] is None else Box(*bounds)


def _put(
    connection: sqlite3.Connection, landmarks: Iterable[Landmark], session: int | None, keep_ids: bool = False
) -> list[int]:
    """Store within a transaction: insert those without id (with keep_ids all), update the others."""
    query = "SELECT 1 FROM sessions WHERE id = ?"
    if session is not None and not connection.execute(query, (session,)).fetchone():
        raise LandmarkMapError(f"There is no session {session}: begin one.")
    ids = []
    for landmark in landmarks:
        values = {name: getattr(landmark, name) for name in COLUMNS}
        values |= {"sigma": landmark.sigma, "second": math.floor(landmark.last_seen), "session": session}
        if landmark.id is None or keep_ids:
            values["id"] = connection.execute(_INSERT, values).lastrowid
        elif not connection.execute(_UPDATE, values).rowcount:
            raise _unknown(landmark.id)
        for statement in (_PLACE, _WIDEN, _REMEMBER):
            connection.execute(statement, values)
        ids.append(values["id"])
    return ids


def _unknown(id: int) -> UnknownLandmarkError:
    return UnknownLandmarkError(f"The map holds no landmark {id}.")
