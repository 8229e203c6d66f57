"""The SQLite file under a landmark map: schema and its versions, connections, transactions, errors.

Write-ahead logging lets readers go on while one connection writes; with synchronous=FULL a transaction that
returned is on the disk. Position and uncertainty are kept in an R*Tree, too: a landmark spans from 0 to its sigma
along the third axis, so that a node tells how uncertain the landmarks in it may be.
"""

import sqlite3
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock

from lidarcore.errors import LandmarkMapError

UNIT = "m"
_APPLICATION = 0x4C4D4150  # "LMAP", in the header of the file
_BUSY_SECONDS = 10.0

# What brings a file from each version to the next; a new version is appended and none is ever edited.
_MIGRATIONS: tuple[tuple[str, ...], ...] = (
    (
        f"PRAGMA application_id = {_APPLICATION}",
        "CREATE TABLE about (unit TEXT NOT NULL) STRICT",
        f"INSERT INTO about VALUES ('{UNIT}')",
        """CREATE TABLE sessions (
            id INTEGER PRIMARY KEY AUTOINCREMENT, source TEXT NOT NULL, started REAL NOT NULL, ended REAL) STRICT""",
        """CREATE TABLE landmarks (
            id INTEGER PRIMARY KEY AUTOINCREMENT, x REAL NOT NULL, y REAL NOT NULL,
            var_x REAL NOT NULL, cov_xy REAL NOT NULL, var_y REAL NOT NULL, sigma REAL NOT NULL,
            kind TEXT NOT NULL, method TEXT NOT NULL, count INTEGER NOT NULL,
            first_seen REAL NOT NULL, last_seen REAL NOT NULL) STRICT""",
        "CREATE VIRTUAL TABLE places USING rtree(id, x_min, x_max, y_min, y_max, sigma_min, sigma_max)",
        # Bounds of all that ever was in the map: only ever wider than need be.
        """CREATE TABLE extent (
            x_min REAL, x_max REAL, y_min REAL, y_max REAL, sigma_min REAL, sigma_max REAL) STRICT""",
        "INSERT INTO extent VALUES (NULL, NULL, NULL, NULL, NULL, NULL)",
        """CREATE TABLE history (
            landmark INTEGER NOT NULL, second INTEGER NOT NULL, session INTEGER REFERENCES sessions(id),
            x REAL NOT NULL, y REAL NOT NULL, var_x REAL NOT NULL, cov_xy REAL NOT NULL, var_y REAL NOT NULL,
            kind TEXT NOT NULL, method TEXT NOT NULL, count INTEGER NOT NULL,
            first_seen REAL NOT NULL, last_seen REAL NOT NULL,
            PRIMARY KEY (landmark, second)) STRICT, WITHOUT ROWID""",
    ),
)


class Database:
    """Connections to one file: one that writes, and as many that read as there are readers at a time."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = Lock()
        self._closed = False
        self._idle: deque[sqlite3.Connection] = deque()
        self._writer = self._connect()
        try:
            self._prepare()
        except BaseException:
            self._writer.close()
            raise

    def close(self) -> None:
        """Close all connections; no query may be under way."""
        with self._lock:
            self._closed = True
            for connection in (*self._idle, self._writer):
                connection.close()
            self._idle.clear()

    @contextmanager
    def reading(self) -> Iterator[sqlite3.Connection]:
        """A connection that sees one state of the map, whatever is written meanwhile."""
        connection = self._idle.pop() if self._idle else self._connect()
        try:
            with self._transaction(connection, "BEGIN"):
                yield connection
        finally:
            self._idle.append(connection)

    @contextmanager
    def writing(self) -> Iterator[sqlite3.Connection]:
        """The connection that writes: all of it is done at the end, or nothing if anything fails."""
        with self._lock, self._transaction(self._writer, "BEGIN IMMEDIATE"):
            yield self._writer

    @contextmanager
    def _transaction(self, connection: sqlite3.Connection, begin: str) -> Iterator[None]:
        with self._explained():
            connection.execute(begin)
            try:
                yield
                connection.execute("COMMIT")
            finally:
                if connection.in_transaction:
                    connection.execute("ROLLBACK")

    def _connect(self) -> sqlite3.Connection:
        if self._closed:
            raise LandmarkMapError(f"The landmark map {self.path} is closed.")
        with self._explained():
            connection = sqlite3.connect(
                self.path, _BUSY_SECONDS, isolation_level=None, check_same_thread=False
            )
            connection.execute("PRAGMA foreign_keys = ON")
            connection.execute("PRAGMA synchronous = FULL")
            connection.execute("PRAGMA mmap_size = 1000000000")
            return connection

    def _prepare(self) -> None:
        with self.writing() as connection:
            for version, statements in list(enumerate(_MIGRATIONS, 1))[self._version(connection) :]:
                for statement in (*statements, f"PRAGMA user_version = {version}"):
                    connection.execute(statement)
            (unit,) = connection.execute("SELECT unit FROM about").fetchone()
            if unit != UNIT:
                raise LandmarkMapError(
                    f"{self.path} is in {unit!r}, not in metres: convert it before it is opened."
                )
        with self._explained():
            self._writer.execute("PRAGMA journal_mode = WAL")

    def _version(self, connection: sqlite3.Connection) -> int:
        """Version of the file's schema, 0 for an empty file; raises LandmarkMapError if it is no map or newer."""
        (version,) = connection.execute("PRAGMA user_version").fetchone()
        (application,) = connection.execute("PRAGMA application_id").fetchone()
        (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        if application != _APPLICATION and (application, version, tables) != (0, 0, 0):
            raise LandmarkMapError(f"{self.path} is a database, but no map of landmarks: give another path.")
        if version > len(_MIGRATIONS):
            raise LandmarkMapError(
                f"{self.path} has version {version}, this program knows up to {len(_MIGRATIONS)}: update lidarcore."
            )
        return int(version)

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            raise LandmarkMapError(f"The landmark map {self.path} cannot be used: {error}.") from error


def path_of(url: str | Path) -> Path:
    """The file a path or a URL such as sqlite:///maps/hall.db names; raises LandmarkMapError for other schemes."""
    text = str(url)
    if text.startswith("sqlite:///"):
        text = text.removeprefix("sqlite:///")
    if "://" in text or text in ("", ":memory:"):
        raise LandmarkMapError(f"{url} is no file for a landmark map: give a path, or sqlite:///path.")
    path = Path(text)
    if "\0" in text or not path.parent.is_dir() or path.is_dir():
        raise LandmarkMapError(f"{path} cannot be a landmark map: give a file in a folder that exists.")
    return path
