"""Where a point landmark appears in the sensor frame, and where a measured point lies in the world.

Measurements are Cartesian: corners and cluster means come as (x, y) with a full 2x2 covariance, which range and
bearing would only hold after a linearisation of its own. Nothing has to be wrapped, nothing is singular at range
zero, and the model is linear in the position of sensor and landmark; it says the same as range and bearing
[EKF 18-20] with their signs corrected.
"""

import numpy as np

from lidarcore.scan import Array


def rotation(heading: float) -> Array:
    """R_world_sensor (2, 2) of a sensor with this heading in rad."""
    c, s = np.cos(heading), np.sin(heading)
    return np.array([[c, -s], [s, c]])


def to_sensor(pose: Array, landmarks: Array) -> tuple[Array, Array, Array]:
    """Landmarks (L, 2) m, world, as seen from T_world_sensor (3,): z = R^T (m - p).

    Returns z (L, 2) m in the sensor frame and its Jacobians by pose (L, 2, 3) and landmark (2, 2).
    """
    R_sensor_world = rotation(pose[2]).T
    z = (landmarks - pose[:2]) @ R_sensor_world.T
    H_pose = np.empty((len(z), 2, 3))
    H_pose[:, :, :2] = -R_sensor_world
    H_pose[:, 0, 2], H_pose[:, 1, 2] = z[:, 1], -z[:, 0]
    return z, H_pose, R_sensor_world


def to_world(pose: Array, points: Array) -> tuple[Array, Array, Array]:
    """Points (K, 2) m, sensor frame, in the world: m = p + R z.

    Returns m (K, 2) m and its Jacobians by pose (K, 2, 3) and point (2, 2).
    """
    R_world_sensor = rotation(pose[2])
    turned = points @ R_world_sensor.T
    G_pose = np.zeros((len(points), 2, 3))
    G_pose[:, 0, 0] = G_pose[:, 1, 1] = 1.0
    G_pose[:, 0, 2], G_pose[:, 1, 2] = -turned[:, 1], turned[:, 0]
    return pose[:2] + turned, G_pose, R_world_sensor
