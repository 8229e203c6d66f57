"""The SQLite file under a landmark map: connections, transactions, errors.

Write-ahead logging lets readers go on while one connection writes; with synchronous=FULL a transaction that
returned is on the disk.
"""

import sqlite3
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock

from lidarcore.errors import LandmarkError, LandmarkMapError
from lidarcore.files import reason
from lidarcore.files.foreign_database import MOST_BYTES
from lidarcore.landmarks.schema import APPLICATION, UNIT, VERSION, expected_schema, migrate, schema_of

PATIENCE = 10.0  # s to wait while another process writes
AT_ONCE = 1000  # rows of a table that one transaction gives up: others wait no longer


class Database:
    """Connections to one file: one that writes, and as many that read as there are readers at a time."""

    def __init__(self, path: Path, patience: float = PATIENCE) -> None:
        self.path, self._patience = path, patience
        self._lock = Lock()
        self._closed = False
        self._idle: deque[sqlite3.Connection] = deque()
        # SQLite takes a file of one byte for an empty one, and writes over it.
        if path.is_file() and path.stat().st_size == 1:
            raise LandmarkMapError(f"The landmark map {path} cannot be used: {_WHY[sqlite3.SQLITE_NOTADB]}.")
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
            if schema_of(connection) != expected_schema(before):
                raise LandmarkMapError(
                    f"The tables of {self.path} are not those of a landmark map: give another path."
                )
            migrate(connection, before, VERSION)
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
        if application != APPLICATION and (application, version, tables) != (0, 0, 0):
            raise LandmarkMapError(f"{self.path} is a database, but not a landmark map: give another path.")
        if version > VERSION:
            raise LandmarkMapError(
                f"{self.path} has version {version}, this program knows up to {VERSION}: update lidarcore."
            )
        return int(version)

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, UnicodeDecodeError) as error:  # the latter by a damaged byte of a text
            raise LandmarkMapError(f"The landmark map {self.path} cannot be used: {_why(error)}.") from error
        except OverflowError as error:
            raise LandmarkError("A number has more than 64 bits: no id is so large.") from error


def path_of(url: str | Path) -> Path:
    """The file a path or a URL such as sqlite:///maps/hall.db names; raises LandmarkMapError for other schemes."""
    text = str(url)
    if text.startswith("sqlite:///"):
        text = text.removeprefix("sqlite:///")
    if not text.strip():
        raise LandmarkMapError("The name of the landmark map is empty: give a path, or sqlite:///path.")
    if "://" in text or text == ":memory:":
        raise LandmarkMapError(f"{url} cannot be the file of a landmark map: give a path, or sqlite:///path.")
    path = Path(text)
    if path.is_dir():
        raise LandmarkMapError(f"{path} is a folder: give a file in it, such as {path / 'landmarks.db'}.")
    if "\0" in text or not path.parent.is_dir():
        raise LandmarkMapError(f"{path} cannot be a landmark map: give a file in a folder that exists.")
    return path


_WHY = {
    sqlite3.SQLITE_NOTADB: "it is no database, or damaged; give another file, or a copy that is whole",
    sqlite3.SQLITE_CORRUPT: "it is damaged; give another file, or a copy that is whole",
    sqlite3.SQLITE_BUSY: "it is locked by another program; end that one, or give another file",
    sqlite3.SQLITE_READONLY: "it may not be written; change its permissions, or give another file",
    sqlite3.SQLITE_CANTOPEN: "it cannot be opened; change its permissions, or give another file",
    sqlite3.SQLITE_FULL: "the disk is full; free some space",
}


def _why(error: Exception) -> str:
    """What SQLite says of a file that its user can mend, in plain words; else as it says it."""
    return _WHY.get(getattr(error, "sqlite_errorcode", 0) & 0xFF, reason(error))
