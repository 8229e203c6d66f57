"""The SQLite file under a landmark map: schema and its versions, connections, transactions, errors.

Write-ahead logging lets readers go on while one connection writes; with synchronous=FULL a transaction that
returned is on the disk. Position, uncertainty and session are kept in an R*Tree, too: a landmark spans from 0 to its
sigma along the third axis, so that a node tells how uncertain the landmarks in it may be, and half a session along
the fourth, since a tree over nodes without extent would not know how to split them.
"""

import sqlite3
from collections import deque
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from threading import Lock

from lidarcore.errors import LandmarkError, LandmarkMapError
from lidarcore.foreign_database import MOST_BYTES

UNIT = "m"
_APPLICATION = 0x4C4D4150  # "LMAP", in the header of the file
PATIENCE = 10.0  # s to wait while another process writes
AT_ONCE = 1000  # rows of a table that one transaction gives up: others wait no longer

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
    (  # each session is a map of its own
        "ALTER TABLE sessions ADD COLUMN mode TEXT NOT NULL DEFAULT ''",
        """INSERT INTO sessions (source, started, ended)
            SELECT 'before sessions', min(first_seen), max(last_seen) FROM history HAVING count(*) > 0""",
        "ALTER TABLE landmarks ADD COLUMN session INTEGER NOT NULL DEFAULT 0",
        "UPDATE landmarks SET session = (SELECT max(id) FROM sessions)",
        "CREATE INDEX landmarks_by_session ON landmarks (session)",
        "DROP TABLE places",
        """CREATE VIRTUAL TABLE places USING rtree(
            id, x_min, x_max, y_min, y_max, sigma_min, sigma_max, session_min, session_max)""",
        "INSERT INTO places SELECT id, x, x, y, y, 0, sigma, session, session + 0.5 FROM landmarks",
        "DROP TABLE extent",
        # Bounds of all that ever was in a session: only ever wider than need be. Deleted last with its session.
        """CREATE TABLE extents (
            session INTEGER PRIMARY KEY, x_min REAL NOT NULL, x_max REAL NOT NULL, y_min REAL NOT NULL,
            y_max REAL NOT NULL, sigma_min REAL NOT NULL, sigma_max REAL NOT NULL) STRICT""",
        """INSERT INTO extents SELECT session, min(x), max(x), min(y), max(y), min(sigma), max(sigma)
            FROM landmarks GROUP BY session""",
        "ALTER TABLE history RENAME TO old_history",
        """CREATE TABLE history (
            landmark INTEGER NOT NULL, second INTEGER NOT NULL, session INTEGER NOT NULL,
            x REAL NOT NULL, y REAL NOT NULL, var_x REAL NOT NULL, cov_xy REAL NOT NULL, var_y REAL NOT NULL,
            kind TEXT NOT NULL, method TEXT NOT NULL, count INTEGER NOT NULL,
            first_seen REAL NOT NULL, last_seen REAL NOT NULL,
            PRIMARY KEY (landmark, second)) STRICT, WITHOUT ROWID""",
        """INSERT INTO history SELECT landmark, second, (SELECT max(id) FROM sessions), x, y, var_x, cov_xy, var_y,
            kind, method, count, first_seen, last_seen FROM old_history""",
        "DROP TABLE old_history",
        "CREATE INDEX history_by_session ON history (session)",
    ),
    (  # walls stand in a map beside landmarks
        """CREATE TABLE walls (
            session INTEGER NOT NULL, id INTEGER NOT NULL, alpha REAL NOT NULL, r REAL NOT NULL,
            var_alpha REAL NOT NULL, cov_alpha_r REAL NOT NULL, var_r REAL NOT NULL,
            x1 REAL NOT NULL, y1 REAL NOT NULL, x2 REAL NOT NULL, y2 REAL NOT NULL,
            length REAL NOT NULL, var_length REAL NOT NULL,
            ended_1 INTEGER NOT NULL, ended_2 INTEGER NOT NULL,
            corner_1 INTEGER NOT NULL, corner_2 INTEGER NOT NULL,
            first_seen REAL NOT NULL, last_seen REAL NOT NULL, count INTEGER NOT NULL,
            PRIMARY KEY (session, id)) STRICT, WITHOUT ROWID""",
    ),
    (  # what walls were; those there are begin theirs with what they are
        """CREATE TABLE wall_history (
            session INTEGER NOT NULL, wall INTEGER NOT NULL, second INTEGER NOT NULL,
            alpha REAL NOT NULL, r REAL NOT NULL,
            var_alpha REAL NOT NULL, cov_alpha_r REAL NOT NULL, var_r REAL NOT NULL,
            x1 REAL NOT NULL, y1 REAL NOT NULL, x2 REAL NOT NULL, y2 REAL NOT NULL,
            length REAL NOT NULL, var_length REAL NOT NULL,
            ended_1 INTEGER NOT NULL, ended_2 INTEGER NOT NULL,
            corner_1 INTEGER NOT NULL, corner_2 INTEGER NOT NULL,
            first_seen REAL NOT NULL, last_seen REAL NOT NULL, count INTEGER NOT NULL,
            PRIMARY KEY (session, wall, second)) STRICT, WITHOUT ROWID""",
        """INSERT INTO wall_history SELECT session, id,
            CAST(last_seen AS INTEGER) - (last_seen < CAST(last_seen AS INTEGER)), alpha, r,
            var_alpha, cov_alpha_r, var_r, x1, y1, x2, y2, length, var_length,
            ended_1, ended_2, corner_1, corner_2, first_seen, last_seen, count FROM walls""",
    ),
    (  # an occupancy grid stands there, too
        """CREATE TABLE grids (
            session INTEGER PRIMARY KEY, resolution REAL NOT NULL,
            x REAL NOT NULL, y REAL NOT NULL, heading REAL NOT NULL,
            rows INTEGER NOT NULL, columns INTEGER NOT NULL, cells BLOB NOT NULL) STRICT""",
    ),
)


class Database:
    """Connections to one file: one that writes, and as many that read as there are readers at a time."""

    def __init__(self, path: Path, patience: float = PATIENCE) -> None:
        self.path, self._patience = path, patience
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
                self.path, self._patience, isolation_level=None, check_same_thread=False
            )
            connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_BYTES)
            connection.execute("PRAGMA trusted_schema = OFF")
            connection.execute("PRAGMA synchronous = FULL")
            connection.execute("PRAGMA mmap_size = 1000000000")
            return connection

    def _prepare(self) -> None:
        with self.writing() as connection:
            before = self._version(connection)
            if _schema(connection) != _expected_schema(before):
                raise LandmarkMapError(
                    f"The tables of {self.path} are not those of a landmark map: give another path."
                )
            _migrate(connection, before, len(_MIGRATIONS))
            (unit,) = connection.execute("SELECT unit FROM about").fetchone()
            if unit != UNIT:
                raise LandmarkMapError(
                    f"{self.path} is in {unit!r}, not in metres: convert it before opening it."
                )
        with self._explained():
            self._writer.execute("PRAGMA journal_mode = WAL")

    def _version(self, connection: sqlite3.Connection) -> int:
        """Version of the file's schema, 0 for an empty file; raises LandmarkMapError if it is no map or newer."""
        (version,) = connection.execute("PRAGMA user_version").fetchone()
        (application,) = connection.execute("PRAGMA application_id").fetchone()
        (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        if application != _APPLICATION and (application, version, tables) != (0, 0, 0):
            raise LandmarkMapError(f"{self.path} is a database, but not a landmark map: give another path.")
        if version > len(_MIGRATIONS):
            raise LandmarkMapError(
                f"{self.path} has version {version}, this program knows up to {len(_MIGRATIONS)}: update lidarcore."
            )
        return int(version)

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, UnicodeDecodeError) as error:  # the latter by a damaged byte of a text
            raise LandmarkMapError(f"The landmark map {self.path} cannot be used: {error}.") from error
        except OverflowError as error:
            raise LandmarkError("A number has more than 64 bits: no id is so large.") from error


def _migrate(connection: sqlite3.Connection, version: int, to: int) -> None:
    for number, statements in list(enumerate(_MIGRATIONS, 1))[version:to]:
        for statement in (*statements, f"PRAGMA user_version = {number}"):
            connection.execute(statement)


def _schema(connection: sqlite3.Connection) -> set[tuple[str, str, str]]:
    query = "SELECT type, name, sql FROM sqlite_master WHERE name NOT LIKE 'sqlite@_%' ESCAPE '@'"
    return set(connection.execute(query))


def _expected_schema(version: int) -> set[tuple[str, str, str]]:
    """What an honest file of this version declares: a column that computes, or a view, makes a query run for ever."""
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as empty:
        _migrate(empty, 0, version)
        return _schema(empty)


def path_of(url: str | Path) -> Path:
    """The file a path or a URL such as sqlite:///maps/hall.db names; raises LandmarkMapError for other schemes."""
    text = str(url)
    if text.startswith("sqlite:///"):
        text = text.removeprefix("sqlite:///")
    if "://" in text or text in ("", ":memory:"):
        raise LandmarkMapError(f"{url} cannot be the file of a landmark map: give a path, or sqlite:///path.")
    path = Path(text)
    if "\0" in text or not path.parent.is_dir() or path.is_dir():
        raise LandmarkMapError(f"{path} cannot be a landmark map: give a file in a folder that exists.")
    return path
