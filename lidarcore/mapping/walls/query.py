"""What walls can be asked: those in a region, of a length, of a direction, nearest to a point."""

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import wrap
from lidarcore.mapping.grid.occupancy import Mask
from lidarcore.mapping.walls.table import WallTable


def distances(walls: WallTable, point: ArrayLike) -> Array:
    """Distance (W,) m of each wall from a point (2,): to its line between the ends, else to the nearer end."""
    a, along, length = _segments(walls)
    to_point = np.asarray(point, np.float64) - a
    t = np.clip((to_point * along).sum(axis=1), 0, length)
    return np.hypot(*(to_point - t[:, None] * along).T)


def nearest(walls: WallTable, point: ArrayLike, number: int) -> Ints:
    """Indices of the walls nearest to a point (2,), the nearest first; so many, or all there are."""
    return np.argsort(distances(walls, point), kind="stable")[:number]


def in_box(walls: WallTable, low: ArrayLike, high: ArrayLike) -> Mask:
    """Which walls (W,) lie at least in part in the rectangle between two corners (2,), its edges included.

    A segment enters a rectangle last where it enters its later slab, and leaves it first where it leaves its earlier.
    """
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    a, step = walls.ends[:, 0], walls.ends[:, 1] - walls.ends[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.sort(np.stack([(low - a) / step, (high - a) / step]), axis=0)
    beside = ((a < low) | (a > high)) & (step == 0)
    enters = np.where(step == 0, 0.0, t[0]).max(axis=1, initial=0.0)
    leaves = np.where(step == 0, 1.0, t[1]).min(axis=1, initial=1.0)
    return (enters <= leaves) & ~beside.any(axis=1)


def along(walls: WallTable, direction: float, tolerance: float) -> Mask:
    """Which walls (W,) run in a direction, rad from the x axis, either way, to within a tolerance (rad)."""
    off = np.abs(wrap(2 * (walls.alpha + np.pi / 2 - direction))) / 2
    return off <= tolerance


def _segments(walls: WallTable) -> tuple[Array, Array, Array]:
    """First ends (W, 2), unit directions (W, 2) and lengths (W,); a wall without length has no direction."""
    a, step = walls.ends[:, 0], walls.ends[:, 1] - walls.ends[:, 0]
    length = np.hypot(*step.T)
    return a, step / np.maximum(length, 1e-12)[:, None], length
