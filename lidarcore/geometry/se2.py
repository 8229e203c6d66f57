"""SE(2), the poses of the plane: group operations, their action on points, and Jacobians.

All functions broadcast over leading axes. Jacobians are by the coordinates (x, y, heading) of a pose.
"""

from math import cos, sin

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array, Numbers


def wrapped(angles: Numbers) -> Numbers:
    """Angles rad wrapped into (-pi, pi]; kernels compile this very function."""
    return np.pi - (np.pi - angles) % (2 * np.pi)


def wrap(angles: ArrayLike) -> Array:
    """Angles (...,) rad wrapped into (-pi, pi]; NaN stays NaN."""
    return wrapped(np.asarray(angles, np.float64))


def unit_vectors(angles: ArrayLike) -> Array:
    """Unit vectors (..., 2) that point along angles (...,) rad."""
    angles = np.asarray(angles, np.float64)
    return _vectors(np.cos(angles), np.sin(angles))


def rotation(heading: ArrayLike) -> Array:
    """R_a_b (..., 2, 2) of a frame b with this heading (...,) rad in frame a."""
    along = unit_vectors(heading)
    return np.stack([along, left_of(along)], -1)


def left_of(vectors: Array) -> Array:
    """Vectors (..., 2) turned left by a quarter: the derivative of a turn."""
    return _vectors(-vectors[..., 1], vectors[..., 0])


def rotate(heading: ArrayLike, vectors: Array) -> Array:
    """R v (..., 2): vectors (..., 2) of a frame with this heading (...,) rad, along the axes it is given in."""
    c, s, x, y = np.cos(heading), np.sin(heading), vectors[..., 0], vectors[..., 1]
    return _vectors(c * x - s * y, s * x + c * y)


def rotate_one(heading: float, x: float, y: float) -> tuple[float, float]:
    """A single vector (x, y) of such a frame: in arrays, two numbers take ten times as long."""
    c, s = cos(heading), sin(heading)
    return c * x - s * y, s * x + c * y


def compose(T_a_b: Array, T_b_c: Array) -> Array:
    """T_a_c (..., 3) of two poses (..., 3)."""
    if T_a_b.ndim == T_b_c.ndim == 1:
        (x, y, heading), (u, v, turn) = T_a_b.tolist(), T_b_c.tolist()
        du, dv = rotate_one(heading, u, v)
        return np.array([x + du, y + dv, wrapped(heading + turn)])
    return _pose(act(T_a_b, T_b_c[..., :2]), T_a_b[..., 2] + T_b_c[..., 2])


def inverse(T_a_b: Array) -> Array:
    """T_b_a (..., 3) of a pose (..., 3)."""
    return _pose(-rotate(-T_a_b[..., 2], T_a_b[..., :2]), -T_a_b[..., 2])


def relative(T_a_b: Array, T_a_c: Array) -> Array:
    """T_b_c (..., 3): pose c seen from b, both (..., 3) given in one frame."""
    if T_a_b.ndim == T_a_c.ndim == 1:
        (x, y, heading), (u, v, other) = T_a_b.tolist(), T_a_c.tolist()
        return np.array([*rotate_one(-heading, u - x, v - y), wrapped(other - heading)])
    return _pose(act_inverse(T_a_b, T_a_c[..., :2]), T_a_c[..., 2] - T_a_b[..., 2])


def pose_difference(pose: Array, other: Array) -> Array:
    """Coordinates of a pose less those of another (..., 3), the heading wrapped: what a covariance is of."""
    difference = pose - other
    difference[..., 2] = wrapped(difference[..., 2])
    return difference


def act(T_a_b: Array, points: Array) -> Array:
    """Points (..., 2) of frame b in frame a: p + R z."""
    return T_a_b[..., :2] + rotate(T_a_b[..., 2], points)


def act_inverse(T_a_b: Array, points: Array) -> Array:
    """Points (..., 2) of frame a in frame b: R^T (m - p)."""
    return rotate(-T_a_b[..., 2], points - T_a_b[..., :2])


def compose_jacobians(T_a_b: Array, T_b_c: Array) -> tuple[Array, Array]:
    """Jacobians (..., 3, 3) of `compose` by its first and its second pose."""
    T_a_c = compose(T_a_b, T_b_c)
    by_first, by_second = _eye(T_a_c), _eye(T_a_c)
    by_first[..., :2, 2] = left_of(T_a_c[..., :2] - T_a_b[..., :2])
    by_second[..., :2, :2] = rotation(T_a_b[..., 2])
    return by_first, by_second


def relative_jacobians(T_a_b: Array, T_a_c: Array) -> tuple[Array, Array]:
    """Jacobians (..., 3, 3) of `relative` by its first and its second pose."""
    T_b_c = relative(T_a_b, T_a_c)
    by_second = _eye(T_b_c)
    by_second[..., :2, :2] = rotation(-T_a_b[..., 2])
    by_first = -by_second
    by_first[..., :2, 2] = -left_of(T_b_c[..., :2])
    return by_first, by_second


def act_jacobians(T_a_b: Array, points: Array) -> tuple[Array, Array]:
    """Jacobians of `act` by the pose (..., 2, 3) and by the point (..., 2, 2)."""
    arms = act(T_a_b, points) - T_a_b[..., :2]
    by_pose = np.zeros((*arms.shape, 3))
    by_pose[..., :2] = np.eye(2)
    by_pose[..., 2] = left_of(arms)
    return by_pose, rotation(T_a_b[..., 2])


def act_inverse_jacobians(T_a_b: Array, points: Array) -> tuple[Array, Array]:
    """Jacobians of `act_inverse` by the pose (..., 2, 3) and by the point (..., 2, 2)."""
    z, R_b_a = act_inverse(T_a_b, points), rotation(-T_a_b[..., 2])
    by_pose = np.empty((*z.shape, 3))
    by_pose[..., :2] = -R_b_a
    by_pose[..., 2] = -left_of(z)
    return by_pose, R_b_a


def _vectors(x: Array, y: Array) -> Array:
    """(..., 2); np.stack takes three times as long for a single one."""
    vectors = np.empty((*x.shape, 2))
    vectors[..., 0], vectors[..., 1] = x, y
    return vectors


def _pose(xy: Array, heading: Array) -> Array:
    return np.concatenate([xy, wrapped(heading)[..., None]], -1)


def _eye(poses: Array) -> Array:
    return np.broadcast_to(np.eye(3), (*poses.shape, 3)).copy()
