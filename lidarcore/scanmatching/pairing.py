"""Which surface each point of a scan lies on, and what that says about the pose [Censi, ICRA 2008]."""

import numpy as np

from lidarcore.compiled import kernel
from lidarcore.localization.kernels import wrap
from lidarcore.scan import Array, Ints
from lidarcore.scanmatching.surface import Surface

_SIDE = 0.7  # cosine of the largest angle between two surfaces that can be the same one
_ROUNDS, _CONVERGED = 30, 1e-5  # m and rad
_SHRINK, _LEAST = 0.7, 1 / 3  # the reach falls by this factor each round, down to this share
_CAUCHY = 4.0  # squared standard deviations at which a distance counts half


@kernel
def pair(reference: Surface, scan: Surface, pose: Array, reach: float, pairs: Ints, rows: Array) -> None:
    """Nearest reference point of each of the scan's N points, -1 for none within reach m on the same side.

    rows (N, 5): derivative of the distance by the pose (3), the distance in m, its weight 1/m².
    """
    c, s = np.cos(pose[2]), np.sin(pose[2])
    for i in range(len(scan.bearings)):
        p = scan.points[i]
        dx, dy = c * p[0] - s * p[1], s * p[0] + c * p[1]
        u, v = pose[0] + dx, pose[1] + dy
        j = _nearest(reference.bearings, reference.points, u, v, reach)
        pairs[i] = -1
        if j < 0:
            continue
        nx, ny = reference.normals[j]
        mx, my = scan.normals[i]
        if nx * (c * mx - s * my) + ny * (s * mx + c * my) < _SIDE:
            continue
        x, y = u - reference.means[j, 0], v - reference.means[j, 1]
        distance, along = nx * x + ny * y, ny * x - nx * y
        leverage = 1 / reference.runs[j, 1] + along * along / reference.spreads[j]
        variance = leverage * _across(reference.covariances[j], nx, ny)
        variance += _across(scan.covariances[i], c * nx + s * ny, c * ny - s * nx)
        pairs[i] = j
        rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3] = nx, ny, ny * dx - nx * dy, distance
        rows[i, 4] = 1 / (variance + distance * distance / _CAUCHY)


@kernel
def align(
    reference: Surface, scan: Surface, guess: Array, prior: Array, x: Array, reach: float, rows: Array
) -> Ints:
    """Gauss-Newton on the distances, from the pose x (3,) on, in place, with pairs found anew each round.

    The guess (3,) takes part with the information prior (3, 3). The reach falls from round to round. Returns the
    pairs (N,), and fills rows (N, 5), as `pair` does.
    """
    pairs, least = np.empty(len(scan.bearings), np.int64), _LEAST * reach
    for _ in range(_ROUNDS):
        pair(reference, scan, x, reach, pairs, rows)
        off = guess - x
        off[2] = wrap(off[2])
        H, g = prior.copy(), prior @ off
        for i in np.flatnonzero(pairs >= 0):
            for a in range(3):
                g[a] -= rows[i, 4] * rows[i, a] * rows[i, 3]
                for b in range(3):
                    H[a, b] += rows[i, 4] * rows[i, a] * rows[i, b]
        step = np.linalg.solve(H, g)
        if reach == least and np.abs(step).max() < _CONVERGED:
            break
        x += step
        reach = max(_SHRINK * reach, least)
    return pairs


@kernel
def _nearest(bearings: Array, points: Array, u: float, v: float, reach: float) -> int:
    """Index of the nearest point within reach; only those at bearings that near points can have are looked at."""
    N, rho = len(bearings), np.hypot(u, v)
    half = np.arcsin(reach / rho) if rho > reach else np.pi
    start = np.arctan2(v, u) - half
    first = np.searchsorted(bearings, (start + np.pi) % (2 * np.pi) - np.pi)
    nearest, j = reach * reach, -1
    for n in range(N):
        k = (first + n) % N
        if (bearings[k] - start) % (2 * np.pi) > 2 * half:
            break
        square = (points[k, 0] - u) ** 2 + (points[k, 1] - v) ** 2
        if square < nearest:
            nearest, j = square, k
    return j


@kernel
def _across(C: Array, nx: float, ny: float) -> float:
    return float(nx * nx * C[0, 0] + 2 * nx * ny * C[0, 1] + ny * ny * C[1, 1])


@kernel
def agreement(reference: Surface, scan: Surface, pose: Array, margin: float) -> tuple[float, float]:
    """Shares of the scan's points that lie about where the reference saw something, and nearer than that.

    margin m, and a tenth of the range; points where the reference saw nothing count as neither.
    """
    c, s = np.cos(pose[2]), np.sin(pose[2])
    N, seen, nearer = len(scan.bearings), 0, 0
    for i in range(N):
        x, y = scan.points[i]
        u, v = pose[0] + c * x - s * y, pose[1] + s * x + c * y
        k = np.searchsorted(reference.bearings, np.arctan2(v, u))
        if k == 0 or k == len(reference.bearings) or reference.bearings[k] - reference.bearings[k - 1] > 0.1:
            continue
        near, far = reference.ranges[k - 1], reference.ranges[k]
        if near > far:
            near, far = far, near
        rho = np.hypot(u, v)
        slack = margin + 0.1 * rho
        if rho < near - slack:
            nearer += 1
        elif rho < far + slack:
            seen += 1
    return seen / max(N, 1), nearer / max(N, 1)
