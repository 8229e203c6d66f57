"""The file of maps: one for each session, since every run of SLAM has a world frame of its own."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lidarcore.closing import Closing
from lidarcore.errors import LandmarkError, UnknownLandmarkError, UnknownSessionError
from lidarcore.landmarks.database import PATIENCE, Database, path_of
from lidarcore.landmarks.landmark import Landmark
from lidarcore.landmarks.landmark_map import LandmarkMap
from lidarcore.landmarks.landmark_store import forget_landmarks, store_landmarks
from lidarcore.landmarks.queries import check_finite
from lidarcore.landmarks.stored_wall import forget_walls

_SESSIONS = """SELECT id, source, mode, started, ended,
    (SELECT count(*) FROM landmarks WHERE landmarks.session = sessions.id),
    (SELECT count(*) FROM walls WHERE walls.session = sessions.id),
    EXISTS (SELECT 1 FROM grids WHERE grids.session = sessions.id), name FROM sessions"""

MAX_NAME = 200
"""Characters of a session's name."""
_JOINERS = {0x200C: None, 0x200D: None}  # which Persian words and some emoji have within them


@dataclass(frozen=True, slots=True)
class Session:
    """One run, or one imported file, whose landmarks share a world frame.

    source, mode    where they come from ("room.mcap") and how ("slam", "import")
    started, ended  s since 1970, by the computer's clock; `ended` None while it runs or if it was killed
    landmarks       how many there are
    walls           likewise
    grid            whether there is an occupancy grid
    name            what people call it; empty if nobody named it
    """

    id: int
    source: str
    mode: str
    started: float
    ended: float | None
    landmarks: int
    walls: int = 0
    grid: bool = False
    name: str = ""


class Atlas(Closing):
    """Maps of landmarks in one file, made if it is not there: `atlas.newest()`, `atlas[session]`.

    Any number of threads and processes may use it, each thread through the same object; reading does not wait for
    writing. Ids of landmarks are unique in the file, and none is given twice.

    Raises LandmarkMapError if the file cannot be used: no map, another version or unit, damaged, locked, disk full.
    """

    def __init__(self, url: str | Path, patience: float = PATIENCE) -> None:
        """Open a path or sqlite:///path; `patience` is for how many seconds to wait while another process writes."""
        self._database = Database(path_of(url), patience)
        self.path = self._database.path

    def close(self) -> None:
        """Close the file; no other call may be under way."""
        self._database.close()

    def begin(
        self,
        source: str,
        started: float,
        mode: str = "",
        landmarks: Iterable[Landmark] = (),
        name: str = "",
    ) -> LandmarkMap:
        """A new session and its map, with new landmarks (id None) if they are known; all or nothing.

        Raises LandmarkError if the name cannot be one.
        """
        check_finite(started=started)
        name = session_name(name)
        with self._database.writing() as connection:
            query = "INSERT INTO sessions (source, mode, started, name) VALUES (?, ?, ?, ?) RETURNING id"
            (session,) = connection.execute(query, (source, mode, started, name)).fetchone()
            store_landmarks(connection, session, landmarks)
        return LandmarkMap(self._database, session)

    def end(self, session: int, ended: float) -> None:
        """Note that a session has ended, at its start if the clock was set back since. Raises UnknownSessionError."""
        check_finite(ended=ended)
        with self._database.writing() as connection:
            query = "UPDATE sessions SET ended = max(?2, started) WHERE id = ?1"
            if not connection.execute(query, (session, ended)).rowcount:
                raise _unknown(session)

    def rename(self, session: int, name: str) -> None:
        """Name a session, without blanks around; an empty name takes away the one it has.

        Raises UnknownSessionError, or LandmarkError if the name is longer than MAX_NAME or cannot be shown.
        """
        name = session_name(name)
        with self._database.writing() as connection:
            query = "UPDATE sessions SET name = ?2 WHERE id = ?1"
            if not connection.execute(query, (session, name)).rowcount:
                raise _unknown(session)

    def sessions(self) -> list[Session]:
        """All sessions, the oldest first."""
        with self._database.reading() as connection:
            return [_session(row) for row in connection.execute(f"{_SESSIONS} ORDER BY id")]

    def session(self, id: int) -> Session:
        """One session; raises UnknownSessionError."""
        with self._database.reading() as connection:
            row = connection.execute(f"{_SESSIONS} WHERE id = ?", (id,)).fetchone()
        if row is None:
            raise _unknown(id)
        return _session(row)

    def __getitem__(self, session: int) -> LandmarkMap:
        """The map of a session; raises UnknownSessionError."""
        with self._database.reading() as connection:
            if not connection.execute("SELECT 1 FROM sessions WHERE id = ?", (session,)).fetchone():
                raise _unknown(session)
        return LandmarkMap(self._database, session)

    def newest(self) -> LandmarkMap | None:
        """The map of the newest session that has landmarks; None if there is none."""
        query = "SELECT max(session) FROM extents WHERE session IN (SELECT id FROM sessions)"
        with self._database.reading() as connection:
            (session,) = connection.execute(query).fetchone()
        return None if session is None else LandmarkMap(self._database, session)

    def newest_to_localize_in(self) -> int | None:
        """The newest session that has landmarks or a grid; None if there is none."""
        query = """SELECT max(id) FROM sessions WHERE
            id IN (SELECT session FROM extents) OR id IN (SELECT session FROM grids)"""
        with self._database.reading() as connection:
            (session,) = connection.execute(query).fetchone()
        return None if session is None else int(session)

    def holding(self, landmark: int) -> LandmarkMap:
        """The map that holds, or held, the landmark with this id; raises UnknownLandmarkError."""
        query = (
            "SELECT session FROM history JOIN sessions ON sessions.id = session WHERE landmark = ? LIMIT 1"
        )
        with self._database.reading() as connection:
            row = connection.execute(query, (landmark,)).fetchone()
        if row is None:
            raise UnknownLandmarkError(f"No map holds a landmark {landmark}.")
        return LandmarkMap(self._database, row[0])

    def delete(self, session: int) -> None:
        """Give up a session, its landmarks and walls and their history; raises UnknownSessionError.

        The session is gone at once and whole; the room it takes is freed bit by bit, so that writers need not wait. If
        that is interrupted, the next call frees it.
        """
        with self._database.writing() as connection:
            if not connection.execute("DELETE FROM sessions WHERE id = ?", (session,)).rowcount:
                raise _unknown(session)
            for table in ("walls", "wall_covariances", "grids"):
                connection.execute(f"DELETE FROM {table} WHERE session = ?", (session,))
        with self._database.reading() as connection:
            left = connection.execute(
                """SELECT session FROM (SELECT session FROM extents UNION SELECT session FROM wall_history)
                    WHERE session NOT IN (SELECT id FROM sessions)"""
            )
            gone = [row[0] for row in left]
        for id in gone:
            forget_landmarks(self._database, id)
            forget_walls(self._database, id)


def _session(row: tuple[Any, ...]) -> Session:
    session = Session(*row)
    return replace(session, grid=bool(session.grid))


def session_name(name: str) -> str:
    """The name without blanks around. Raises LandmarkError if it is longer than MAX_NAME or cannot be shown."""
    name = name.strip()
    if len(name) > MAX_NAME:
        raise LandmarkError(f"The name has {len(name)} characters: give one of at most {MAX_NAME}.")
    shown = name.translate(_JOINERS).strip()
    if not shown.isprintable():
        raise LandmarkError(f"The name {name!r} has characters that cannot be shown: leave them out.")
    return name if shown else ""


def _unknown(session: int) -> UnknownSessionError:
    return UnknownSessionError(f"There is no session {session}.")
