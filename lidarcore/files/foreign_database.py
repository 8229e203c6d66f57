"""SQLite files that somebody else wrote: what their schema may compute is bounded, in memory and in steps."""

import sqlite3

MOST_BYTES = 1 << 26  # of one value: a longer one ends the query with sqlite3.DataError
_STEPS_PER_BYTE = 100  # of the file: reading every row of a plain table takes less than ten
_ASK_AFTER = 1_000_000  # steps of the database's machine


def bound(database: sqlite3.Connection, size: int) -> None:
    """Let a file of `size` bytes be read, but not compute: beyond that a query ends with sqlite3.Error.

    A value may have MOST_BYTES; all queries together may take the steps that reading the file takes, many times over.
    """
    database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_BYTES)
    database.execute("PRAGMA trusted_schema = OFF")
    left = _ASK_AFTER + _STEPS_PER_BYTE * size

    def is_exhausted() -> bool:
        nonlocal left
        left -= _ASK_AFTER
        return left < 0

    database.set_progress_handler(is_exhausted, _ASK_AFTER)


def stores_its_columns(database: sqlite3.Connection, table: str) -> bool:
    """True if this is a table, not a view, and its columns hold what they were given: none is computed when read."""
    columns = database.execute(
        "SELECT type FROM pragma_table_list WHERE schema = 'main' AND name = ?", (table,)
    )
    hidden = database.execute("SELECT hidden FROM pragma_table_xinfo(?)", (table,))
    return columns.fetchall() == [("table",)] and not any(number for (number,) in hidden)
