"""An occupancy grid as the file of maps keeps it."""

import sqlite3
from dataclasses import astuple, dataclass, fields


@dataclass(frozen=True, slots=True)
class StoredGrid:
    """Cells and where they lie.

    resolution     m, side of a cell
    x, y, heading  m, m, rad: T_world_grid, the outer corner of the first cell of the first row
    rows, columns  how many there are
    cells          one signed byte each, row by row, compressed by zlib
    """

    resolution: float
    x: float
    y: float
    heading: float
    rows: int
    columns: int
    cells: bytes


_COLUMNS = ", ".join(one.name for one in fields(StoredGrid))


def replace_grid(connection: sqlite3.Connection, session: int, grid: StoredGrid) -> None:
    """Store the grid of a session in place of that which it has."""
    query = f"INSERT OR REPLACE INTO grids (session, {_COLUMNS}) VALUES (?, ?, ?, ?, ?, ?, ?, ?)"
    connection.execute(query, (session, *astuple(grid)))


def grid_of(connection: sqlite3.Connection, session: int) -> StoredGrid | None:
    """The grid of a session, if it has one."""
    row = connection.execute(f"SELECT {_COLUMNS} FROM grids WHERE session = ?", (session,)).fetchone()
    return None if row is None else StoredGrid(*row)
