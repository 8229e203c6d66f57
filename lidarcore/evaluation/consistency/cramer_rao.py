"""The Cramér-Rao bound of lines and corners: what no unbiased estimator can beat under the noise model [CWLF 10]."""

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array
from lidarcore.compiled import inlined
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
    rows = [_bounded(*line, angles, noise) for line, angles in zip(lines, bearings, strict=True)]
    corner = np.empty(CORNER_FIELDS)
    intersect(rows[0], rows[1], corner)
    return corner[CORNER_CONSISTENT : CORNER_CONSISTENT + 4].reshape(2, 2)


def _bounded(alpha: float, r: float, bearings: ArrayLike, noise: SensorNoise) -> Array:
    row, variances = np.empty(LINE_FIELDS), (noise.sigma_range**2, noise.sigma_bearing**2)
    bounded_line(as_row(bearings, "bearings"), np.cos(alpha), np.sin(alpha), r, *variances, row)
    return row


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
