"""Walls of which it is known how they err together: all that measuring needs, of a map that is made or was kept."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array

from lidarcore.arrays import Array, Ints
from lidarcore.mapping.walls.spread import spread_by
from lidarcore.mapping.walls.table import WallTable

Singles = NDArray[np.float32]
NUMBERS = 4  # of the ends of a wall: x and y of the first, x and y of the second


class JointModel(Protocol):
    """What the covariances of W walls come from: S numbers, of which all that is measured is a linear function."""

    def covariance(self, rows: csr_array) -> Array:
        """(R, R) of quantities that are R linear functions (R, S) of the numbers."""

    def ends_of(self, *walls: int) -> csr_array:
        """Rows (4 N, S): x and y of both ends of walls, one after the other."""


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """C corners where walls meet.

    xy    (C, 2) m
    rows  (2 C, S) how they follow from the numbers of a `JointModel`
    """

    xy: Array
    rows: csr_array = field(repr=False)

    def __len__(self) -> int:
        return len(self.xy)

    def rows_of(self, k: int) -> csr_array:
        """Rows (2, S) of one corner."""
        return self.rows[2 * k : 2 * k + 2]


@dataclass(frozen=True, slots=True, eq=False)
class JointWalls(WallTable):
    """Walls, and what they have in common: they can be measured.

    corners  where walls meet
    model    what the covariances come from, for what walls have in common
    """

    corners: Corners
    model: JointModel = field(repr=False)


@dataclass(frozen=True, slots=True, eq=False)
class EndsModel:
    """The covariance of the ends itself, and nothing behind it.

    ends  (4 W, 4 W) m²: x and y of both ends of every wall
    """

    ends: Singles

    def covariance(self, rows: csr_array) -> Array:
        """(R, R) of quantities that are R linear functions (R, 4 W) of the ends."""
        return spread_by(self.ends, rows)

    def ends_of(self, *walls: int) -> csr_array:
        """Rows (4 N, 4 W): x and y of both ends of walls, one after the other."""
        return self.rows_at([NUMBERS * i + k for i in walls for k in range(NUMBERS)])

    def rows_at(self, numbers: list[int]) -> csr_array:
        """Rows (N, 4 W) that are some of the numbers."""
        return csr_array(eye_array(len(self.ends), format="csr")[numbers])


def corner_ends(walls: WallTable) -> Ints:
    """(C, 2) which wall, and which end of it, for every place where ends of walls are corners, each place once."""
    found = np.argwhere(walls.in_corner)
    _, first = np.unique(walls.ends[walls.in_corner].round(6), axis=0, return_index=True)
    ends: Ints = found[first]
    return ends


def joint_walls(walls: WallTable, covariance: Singles) -> JointWalls:
    """Walls whose ends err together by a covariance (4 W, 4 W) m²; their corners are the ends that are corners."""
    model, (at, side) = EndsModel(covariance), corner_ends(walls).T
    first = NUMBERS * at + 2 * side
    rows = model.rows_at(np.stack([first, first + 1], 1).ravel().tolist())
    columns = {name: getattr(walls, name) for name in WallTable.__dataclass_fields__}
    return JointWalls(**columns, corners=Corners(walls.ends[at, side], rows), model=model)
