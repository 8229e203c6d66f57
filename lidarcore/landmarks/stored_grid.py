"""An occupancy grid as the file of maps keeps it."""

from dataclasses import dataclass


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
