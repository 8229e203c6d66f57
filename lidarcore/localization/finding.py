"""Finds the pose of a running filter in the filter's own map."""

import numpy as np

from lidarcore.localization.filters import Filter
from lidarcore.localization.points import Points
from lidarcore.localization.relocalization import relocalize
from lidarcore.scan import Array

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
