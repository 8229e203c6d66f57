"""The Cramér-Rao bound of lines and corners: what no unbiased estimator can beat under the noise model [CWLF 10]."""

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import inlined, kernel
from lidarcore.corners import intersect
from lidarcore.lines import LINE_FIELDS
from lidarcore.noise import SensorNoise
from lidarcore.scan import as_row
from lidarcore.tables import (
    CORNER_CONSISTENT,
    CORNER_FIELDS,
    DISTANCE,
    LINE_CONSISTENT,
    LINE_MAP,
    LINE_PUBLISHED,
    NORMAL,
)


def corner_bound(
    lines: tuple[tuple[float, float], tuple[float, float]],
    bearings: tuple[ArrayLike, ArrayLike],
    noise: SensorNoise,
) -> Array:
    """Bound (2, 2) m² for the corner of two walls x cos(alpha) + y sin(alpha) = r, each (alpha rad, r m), sensor frame.

    bearings (N,) rad are the true ones at which beams meet each wall. They are unknown to an estimator too; with them
    eliminated, a beam is worth the inverse of its effective variance.
    """
    angles = [as_row(of_wall, "bearings") for of_wall in bearings]
    count = np.array([[len(of_wall) for of_wall in angles]])
    normals = np.array([[(np.cos(alpha), np.sin(alpha), r) for alpha, r in lines]])
    bounds, variances = np.empty((1, 2, 2)), (noise.sigma_range**2, noise.sigma_bearing**2)
    bound_corners(np.concatenate(angles), np.cumsum(count, 1) - count, count, normals, *variances, bounds)
    return bounds[0]


@kernel
def bound_corners(
    bearings: Array, first: Ints, count: Ints, lines: Array, v_rho: float, v_theta: float, bounds: Array
) -> None:
    """Write bounds (P, 2, 2) m² of corners into `bounds`.

    Beams of both walls of each begin at first (P, 2) and are count (P, 2) of the true bearings (N,) rad; lines
    (P, 2, 3) are unit normals and distances in m.
    """
    rows, corner = np.empty((2, LINE_FIELDS)), np.empty(CORNER_FIELDS)
    for p in range(len(first)):
        for k in range(2):
            a = first[p, k]
            nx, ny, r = lines[p, k]
            bounded_line(bearings[a : a + count[p, k]], nx, ny, r, v_rho, v_theta, rows[k])
        intersect(rows[0], rows[1], corner)
        bounds[p] = corner[CORNER_CONSISTENT : CORNER_CONSISTENT + 4].copy().reshape(2, 2)


@inlined
def bounded_line(
    bearings: Array, nx: float, ny: float, r: float, v_rho: float, v_theta: float, row: Array
) -> None:
    """Write a true line and its bound into a row (LINE_FIELDS,), in place of its covariances.

    A beam measures e = x cos(alpha) + y sin(alpha) - r; with t its coordinate along the wall, de = t dalpha - dr.
    """
    aa = ar = rr = 0.0
    for i in range(len(bearings)):
        c, s = np.cos(bearings[i]), np.sin(bearings[i])
        across = nx * c + ny * s
        t = r * (nx * s - ny * c) / across
        information = 1 / (v_rho * across * across + v_theta * t * t)
        aa += information * t * t
        ar -= information * t
        rr += information
    det = aa * rr - ar * ar
    row[NORMAL], row[NORMAL + 1], row[DISTANCE] = nx, ny, r
    for at in (LINE_PUBLISHED, LINE_CONSISTENT, LINE_MAP):
        _fill(row, at, rr / det, -ar / det, aa / det)


@inlined
def _fill(row: Array, at: int, xx: float, xy: float, yy: float) -> None:
    row[at], row[at + 1], row[at + 2], row[at + 3] = xx, xy, xy, yy
