"""The map as it is after a scan."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from lidarcore.errors import LocalizationError
from lidarcore.localization.points import Points
from lidarcore.scan import Array, Ints


@dataclass(frozen=True, slots=True, eq=False)
class Landmarks:
    """A snapshot of L landmarks, world frame. Arrays are read-only.

    ids         (L,) a number for each that is never given to another landmark of this map
    points      positions with covariances and kinds
    confirmed   (L,) true for those seen often enough; the others are tentative
    counts      (L,) how often each was seen
    first_seen  (L,) s
    last_seen   (L,) s

    Raises LocalizationError if a column is not of the length of the points, or an id is there twice.
    """

    ids: Ints
    points: Points
    confirmed: NDArray[np.bool_]
    counts: Ints
    first_seen: Array
    last_seen: Array

    def __post_init__(self) -> None:
        for name, kind in _COLUMNS.items():
            column: NDArray[Any] = np.array(getattr(self, name), kind)
            if column.shape != (len(self.points),):
                raise LocalizationError(
                    f"{name} has shape {column.shape}: give one for each of the {len(self.points)} landmarks."
                )
            column.flags.writeable = False
            object.__setattr__(self, name, column)
        if len(np.unique(self.ids)) < len(self.ids):
            raise LocalizationError("Two landmarks have the same id: give each one of its own.")

    def __len__(self) -> int:
        return len(self.ids)

    @classmethod
    def of(cls, points: Points) -> Self:
        """A map known beforehand: all confirmed, numbered from 0, not seen in this run."""
        L = len(points)
        return cls(
            np.arange(L), points, np.ones(L, np.bool_), np.zeros(L, np.int64), np.zeros(L), np.zeros(L)
        )

    def subset(self, which: NDArray[np.bool_]) -> Self:
        """Those of which (L,) is true."""
        columns = {name: getattr(self, name)[which] for name in _COLUMNS}
        return type(self)(points=self.points.subset(which), **columns)


_COLUMNS = {
    "ids": np.int64,
    "confirmed": np.bool_,
    "counts": np.int64,
    "first_seen": np.float64,
    "last_seen": np.float64,
}
