"""The filters that a Navigator drives: which one the settings ask for, and relocation in its map."""

from dataclasses import replace

import numpy as np

from lidarcore.arrays import Array
from lidarcore.localization.ekf.localizer import KnownMap
from lidarcore.localization.ekf.slam import Slam
from lidarcore.localization.landmarks import Landmarks
from lidarcore.localization.points import Points
from lidarcore.localization.relocation import relocalize
from lidarcore.localization.settings import NavigationSettings

Filter = Slam | KnownMap
"""Both have the same methods."""

_REST = 5.0  # s; people who stand are clusters, and seldom stand longer


def make_filter(
    settings: NavigationSettings, has_odometry: bool, pose: Array, covariance: Array, known: Landmarks
) -> Filter:
    """The filter that the settings ask for, at a pose (3,) with covariance (3, 3), in or with a map."""
    motion = settings.motion
    if motion == "auto":
        motion = "odometry" if has_odometry else "constant velocity"
    settle = (
        max(settings.filter.settle, _REST) if settings.landmarks == "clusters" else settings.filter.settle
    )
    chosen = replace(settings.filter, motion=motion, settle=settle)
    if settings.mode == "localize":
        return KnownMap(chosen, pose, covariance, known)
    return Slam(chosen, pose, covariance, known)


LEAST = 4  # confirmed landmarks, without which no pose is found in a map
_DOUBT = 25.0  # the covariance of a pose found from a scan grows so much before the same scan corrects it


def is_recognisable(running: Filter) -> bool:
    """There are landmarks enough to find the pose by."""
    return bool(np.count_nonzero(running.map.confirmed) >= LEAST)


def find(running: Filter, observed: Points, near: tuple[Array, Array] | None = None) -> tuple[Array, Array]:
    """Set the filter to the pose (3,) from which the map explains what is seen; pose and covariance (3, 3).

    near, if given: a pose and a covariance it must agree with. Raises LostError, and nothing has changed.
    """
    known = running.map
    found = relocalize(observed, known.subset(known.confirmed).points, near=near)
    covariance = _DOUBT * found.covariance
    running.reset(found.pose, covariance)
    return found.pose, covariance
