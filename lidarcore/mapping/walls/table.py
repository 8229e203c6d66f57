"""Walls as they are told and kept: where they are and how sure that is, each for itself."""

from dataclasses import dataclass

from lidarcore.arrays import Array, Ints
from lidarcore.mapping.grid.occupancy import Mask


@dataclass(frozen=True, slots=True, eq=False)
class WallTable:
    """W walls in the world, each a surface seen from one side: x cos(alpha) + y sin(alpha) = r.

    ids              (W,) which is which; those of a map that grows stay, see `WallIds`
    alpha            (W,) rad, in (-pi, pi]
    r                (W,) m, >= 0
    line_covariance  (W, 2, 2) of (alpha, r)
    ends             (W, 2, 2) m; who looks from the first to the second has the free side on the left
    ended            (W, 2) false where the wall may go on, for nobody looked past it
    in_corner        (W, 2) true where an end is a corner
    length           (W,) m
    length_variance  (W,) m²
    first_seen       (W,) s
    last_seen        (W,) s
    count            (W,) number of scans of the map that saw it
    """

    ids: Ints
    alpha: Array
    r: Array
    line_covariance: Array
    ends: Array
    ended: Mask
    in_corner: Mask
    length: Array
    length_variance: Array
    first_seen: Array
    last_seen: Array
    count: Ints

    def __len__(self) -> int:
        return len(self.alpha)
