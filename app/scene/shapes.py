"""Geometry of what the scene draws: ellipses, polylines, sectors. Metres, z = 0."""

import numpy as np
from numpy.typing import NDArray

from lidarcore import Scan
from lidarcore.geometry import ellipse_axes, ellipse_outline, unit_vectors

Array = NDArray[np.float64]

CIRCLE = unit_vectors(np.linspace(0, 2 * np.pi, 33))  # (33, 2), closed
DISC_VERTICES = np.vstack([np.zeros(3), np.column_stack([CIRCLE[:-1], np.zeros(32)])])
DISC_FACES = np.array([(0, i, i % 32 + 1) for i in range(1, 33)])


def lift(xy: Array, z: float = 0.0) -> NDArray[np.float32]:
    """(..., 2) to (..., 3) float32 at the given height."""
    return np.concatenate([xy, np.full((*xy.shape[:-1], 1), z)], -1).astype(np.float32)


def polylines(points: Array) -> Array:
    """(C, P, 2) polylines as (C * (P - 1), 2, 2) separate strokes."""
    return np.stack([points[:, :-1], points[:, 1:]], 2).reshape(-1, 2, 2)


def wedge(start: float, end: float) -> Array:
    """Outline of the sector of the unit circle from one bearing counter-clockwise to the other, rad: (33, 2)."""
    arc = start + np.linspace(0, (end - start) % (2 * np.pi), len(CIRCLE) - 2)
    return np.vstack([np.zeros(2), unit_vectors(arc), np.zeros(2)])


def ellipses(xy: Array, covariance: Array, scale: float) -> tuple[Array, Array, Array]:
    """Half axes (C, 2), angle of the first (C,), outlines (C, 33, 2); covariances (C, 2, 2) at xy (C, 2)."""
    half, axes = ellipse_axes(covariance, scale)
    outline = ellipse_outline(xy, covariance, scale, len(CIRCLE))
    return half, np.arctan2(axes[:, 1, 0], axes[:, 0, 0]), outline


def about_z(angle: Array) -> NDArray[np.float32]:
    """Rotations about z as quaternions w, x, y, z: (C, 4)."""
    zero = np.zeros_like(angle)
    return np.stack([np.cos(angle / 2), zero, zero, np.sin(angle / 2)], -1).astype(np.float32)


def beams_between(scan: Scan, first: int, last: int) -> NDArray[np.int64]:
    """Indices of the beams with a return from first to last along the ring, which may pass its end."""
    n = len(scan)
    beams = np.arange(first, last + 1 if last >= first else last + 1 + n) % n
    return beams[scan.valid[beams]]
