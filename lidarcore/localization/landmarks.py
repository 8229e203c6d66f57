"""The map of a filter after a scan, and its exchange with files and databases of landmarks."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.errors import LocalizationError
from lidarcore.landmarks.landmark import Landmark
from lidarcore.localization.points import Points


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
    confirmed: Bools
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

    def subset(self, which: Bools) -> Self:
        """The landmarks of which (L,) is true."""
        columns = {name: getattr(self, name)[which] for name in _COLUMNS}
        return type(self)(points=self.points.subset(which), **columns)


_COLUMNS = {
    "ids": np.int64,
    "confirmed": np.bool_,
    "counts": np.int64,
    "first_seen": np.float64,
    "last_seen": np.float64,
}


def to_stored(landmarks: Landmarks, method: str = "") -> list[Landmark]:
    """The confirmed landmarks as a file or a `LandmarkMap` takes them, without ids; `method` is what found them."""
    confirmed = landmarks.subset(landmarks.confirmed)
    points = confirmed.points
    rows = zip(
        points.xy,
        points.covariance,
        np.asarray(points.kinds).tolist(),
        np.maximum(confirmed.counts, 1).tolist(),
        confirmed.first_seen.tolist(),
        confirmed.last_seen.tolist(),
        strict=True,
    )
    return [
        Landmark.of(xy, covariance, kind, method=method, count=count, first_seen=first, last_seen=last)
        for xy, covariance, kind, count, first, last in rows
    ]


def from_stored(landmarks: Iterable[Landmark]) -> Landmarks:
    """Landmarks of a file or a `LandmarkMap` as a map to localize in, with their ids there, else numbered."""
    found = list(landmarks)

    def column(name: str) -> NDArray[Any]:
        return np.array([getattr(landmark, name) for landmark in found])

    C = np.stack([column("var_x"), column("cov_xy"), column("cov_xy"), column("var_y")], -1).reshape(-1, 2, 2)
    points = Points(np.stack([column("x"), column("y")], -1), C, column("kind").astype(np.str_))
    ids = [place if landmark.id is None else landmark.id for place, landmark in enumerate(found)]
    seen = (column(name) for name in ("count", "first_seen", "last_seen"))
    return Landmarks(np.array(ids), points, np.ones(len(found), np.bool_), *seen)
