"""Rows of the table that kernels write, seen as what they are of: nothing is copied until it is asked for."""

from lidarcore.arrays import Array
from lidarcore.settings import Covariance


class TableView:
    """Rows of a kernel's table, and which of the covariances `covariance` means."""

    def __init__(self, table: Array, which: Covariance) -> None:
        self._table = table
        self._which = which

    def __len__(self) -> int:
        return len(self._table)

    def __repr__(self) -> str:
        return f"<{len(self)} {type(self).__name__.lower()}, {self._which} covariances>"

    def _matrices(self, column: int) -> Array:
        return self._table[:, column : column + 4].reshape(-1, 2, 2)
