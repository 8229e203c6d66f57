"""The pose between the cells: points are matched to what stands nearest, along the normal of the distance to it."""

import numpy as np
from scipy.ndimage import map_coordinates

from lidarcore.arrays import Array
from lidarcore.geometry import rotate, wrap
from lidarcore.mapping.relocation.field import FULL, Field

_ROUNDS = 10
_FLOOR = 0.5  # cells: a map is not known better than this, however many points lie on it


def refined(field: Field, points: Array, pose: Array) -> tuple[Array, Array]:
    """Gauss-Newton on the fits of points (N, 2) from a pose (3,), all in cells: the pose and its covariance.

    [Kohlbrecher et al. 2011], with the covariance of point positions of half a cell that are wrong together.
    """
    level, corner = _around(field, points, pose)
    dy, dx = (np.asarray(np.gradient(level, axis=axis), np.float64) for axis in (0, 1))
    pose = pose - corner
    for _ in range(_ROUNDS):
        fit, J = _linearised(level, dx, dy, points, pose)
        H = J.T @ J + 1e-6 * np.eye(3)
        step = np.linalg.solve(H, J.T @ (1 - fit))
        step *= min(1.0, 1.0 / max(np.hypot(*step[:2]), 1e-12), 0.02 / max(abs(step[2]), 1e-12))
        moved: Array = pose + step
        if _linearised(level, dx, dy, points, moved)[0].sum() <= fit.sum():
            break
        pose = moved.astype(np.float64)
    pose[2] = wrap(pose[2])
    _, J = _linearised(level, dx, dy, points, pose)
    norm = np.hypot(J[:, 0], J[:, 1])
    used = norm > 1e-3
    N = J[used] / norm[used][:, None]  # the normals, and the levers that go with them
    information = N.T @ N / max(len(N), 1) / _FLOOR**2
    covariance = np.linalg.inv(information + 1e-6 * np.eye(3)).astype(np.float64)
    return pose + corner, covariance


def _around(field: Field, points: Array, pose: Array) -> tuple[Array, Array]:
    """What of the fits points can meet on the way from a pose, and its corner (3,): column, row, and no angle."""
    far = float(np.hypot(*points.T).max()) + _ROUNDS + 2
    low = np.maximum(np.floor(pose[:2] - far), 0).astype(int)
    high = np.ceil(pose[:2] + far).astype(int)
    part = field.levels[0][low[1] : high[1], low[0] : high[0]]
    return part.astype(np.float64) / FULL, np.array([*low, 0.0])


def _linearised(level: Array, dx: Array, dy: Array, points: Array, pose: Array) -> tuple[Array, Array]:
    """Fits (N,) of points at a pose and their Jacobian (N, 3)."""
    x, y = rotate(pose[2], points).T
    at = np.stack([y + pose[1] - 0.5, x + pose[0] - 0.5])
    fit, gx, gy = (map_coordinates(table, at, order=1) for table in (level, dx, dy))
    return fit, np.stack([gx, gy, -y * gx + x * gy], -1)
