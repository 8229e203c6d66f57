"""Planar poses (x m, y m, heading rad) as arrays (3,): T_parent_child."""

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.scan import Array


def wrapped(angles: Array) -> Array:
    """Angles rad wrapped into (-pi, pi], the one place where they are, for kernels too; NaN stays NaN."""
    return np.pi - (np.pi - angles) % (2 * np.pi)


def wrap(angles: ArrayLike) -> Array:
    """Angles (...,) rad wrapped into (-pi, pi]; NaN stays NaN."""
    return wrapped(np.asarray(angles, np.float64))


def compose(T_a_b: Array, T_b_c: Array) -> Array:
    """T_a_c of two poses (3,)."""
    c, s = np.cos(T_a_b[2]), np.sin(T_a_b[2])
    x, y, heading = T_b_c
    return np.array([T_a_b[0] + c * x - s * y, T_a_b[1] + s * x + c * y, wrap(T_a_b[2] + heading)])


def inverse(T_a_b: Array) -> Array:
    """T_b_a of a pose (3,)."""
    x, y, heading = T_a_b
    c, s = np.cos(heading), np.sin(heading)
    return np.array([-c * x - s * y, s * x - c * y, wrap(-heading)])


class PoseTrack:
    """Poses over time, interpolated linearly, headings along the shorter turn.

    Takes stamps (M,) s in any order and poses (M, 3) in one frame; entries that are not finite are left out.
    """

    def __init__(self, stamps: Array, poses: Array) -> None:
        table = np.column_stack([stamps, poses])
        table = table[np.isfinite(table).all(axis=1)]
        table = table[np.argsort(table[:, 0], kind="stable")]
        self._stamps, self._x, self._y = table[:, 0], table[:, 1], table[:, 2]
        self._heading = np.unwrap(table[:, 3])

    def __len__(self) -> int:
        return len(self._stamps)

    def at(self, stamp: float) -> Array | None:
        """Pose (3,) at the stamp in s, or None before the first or after the last pose."""
        if not len(self) or not self._stamps[0] <= stamp <= self._stamps[-1]:
            return None
        x, y, heading = (
            np.interp(stamp, self._stamps, values) for values in (self._x, self._y, self._heading)
        )
        return np.array([x, y, wrap(heading)])
