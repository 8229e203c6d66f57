"""The tree of coordinate frames in a ROS recording's tf messages."""

from typing import Any

import numpy as np

from lidarcore.arrays import Array
from lidarcore.recordings.ros.messages import frame

MOST_FRAMES = 10_000  # robots have hundreds


class FrameTree:
    """Remembers each frame's transform to its parent, the first seen; static ones win over moving ones."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Array, bool]] = {}

    def add(self, message: Any, *, static: bool) -> None:
        """Take up a TFMessage."""
        for transform in message.transforms:
            child, parent = frame(transform.child_frame_id), frame(transform.header.frame_id)
            if len(self._parents) >= MOST_FRAMES and child not in self._parents:
                continue
            if child not in self._parents or (static and not self._parents[child][2]):
                self._parents[child] = parent, _matrix(transform.transform), static

    def mounting(self, base: str | None, sensor: str) -> Array | None:
        """T_base_sensor (4, 4), or None if the tree does not connect the two.

        Without a base: from "base_link" if that is among the sensor's ancestors, else the topmost static.
        """
        T = np.eye(4)
        chain = {}
        while sensor in self._parents and sensor not in chain:
            chain[sensor] = T
            parent, T_parent_child, static = self._parents[sensor]
            if base is None and not static:
                break
            T, sensor = T_parent_child @ T, parent
        chain.setdefault(sensor, T)
        if base is None:
            base = "base_link" if "base_link" in chain else sensor
            return chain[base] if len(chain) > 1 else None
        return chain.get(base)


def planar(T: Array) -> tuple[Array, float]:
    """Pose (3,) of a transform (4, 4) seen from above, and the cosine of the angle between the two z axes."""
    return np.array([T[0, 3], T[1, 3], np.arctan2(T[1, 0], T[0, 0])]), float(T[2, 2])


def _matrix(transform: Any) -> Array:
    """Make (4, 4) of a geometry_msgs/Transform; a quaternion of zeros, as some nodes send, is no rotation."""
    t = transform.translation
    T = np.eye(4)
    T[:3, :3] = rotation(transform.rotation)
    T[:3, 3] = t.x, t.y, t.z
    return T


def rotation(quaternion: Any) -> Array:
    """Rotation matrix (3, 3) of a quaternion of any length (Horn 1987, section 3.C)."""
    q = np.array([quaternion.w, quaternion.x, quaternion.y, quaternion.z])
    norm = q @ q
    if not 0 < norm < np.inf:
        return np.eye(3)
    w, x, y, z = q / np.sqrt(norm)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
