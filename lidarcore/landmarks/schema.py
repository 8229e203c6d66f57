"""The tables of a file of maps, in every version that there was.

Position, uncertainty and session are kept in an R*Tree, too: a landmark spans from 0 to its sigma along the third
axis, so that a node tells how uncertain the landmarks in it may be, and half a session along the fourth, since a tree
over nodes without extent would not know how to split them.
"""

import sqlite3
from contextlib import closing

UNIT = "m"
APPLICATION = 0x4C4D4150  # "LMAP", in the header of the file

# What brings a file from each version to the next; a new version is appended and none is ever edited.
_MIGRATIONS: tuple[tuple[str, ...], ...] = (
    (
        f"PRAGMA application_id = {APPLICATION}",
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
    (  # sessions may have names
        "ALTER TABLE sessions ADD COLUMN name TEXT NOT NULL DEFAULT ''",
    ),
    (  # how the walls of a finished map err together
        "CREATE TABLE wall_covariances (session INTEGER PRIMARY KEY, packed BLOB NOT NULL) STRICT",
    ),
)
VERSION = len(_MIGRATIONS)


def migrate(connection: sqlite3.Connection, version: int, to: int) -> None:
    """Bring a file from one version (0: empty) to another, within the transaction under way."""
    for number, statements in list(enumerate(_MIGRATIONS, 1))[version:to]:
        for statement in (*statements, f"PRAGMA user_version = {number}"):
            connection.execute(statement)


def schema_of(connection: sqlite3.Connection) -> set[tuple[str, str, str]]:
    """Type, name and declaration of all that a file holds."""
    query = "SELECT type, name, sql FROM sqlite_master WHERE name NOT LIKE 'sqlite@_%' ESCAPE '@'"
    return set(connection.execute(query))


def expected_schema(version: int) -> set[tuple[str, str, str]]:
    """What an honest file of this version declares: a column that computes, or a view, makes a query run for ever."""
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as empty:
        migrate(empty, 0, version)
        return schema_of(empty)
