"""What the filters that a Navigator drives have in common: an interface, a factory, relocation in their map."""

from dataclasses import replace
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array
from lidarcore.localization.ekf.estimate import Estimate
from lidarcore.localization.ekf.localizer import KnownMap
from lidarcore.localization.ekf.slam import Slam, Visible
from lidarcore.localization.landmarks import Landmarks
from lidarcore.localization.points import Points
from lidarcore.localization.relocation import relocalize
from lidarcore.localization.settings import LocalizationSettings, NavigationSettings

_REST = 5.0  # s; people who stand are clusters, and seldom stand longer


class Filter(Protocol):
    """Slam, or KnownMap with the same interface."""

    @property
    def settings(self) -> LocalizationSettings:
        """The settings, with the motion model in use."""

    @property
    def map(self) -> Landmarks:
        """The map as it is now."""

    @property
    def is_at_odds(self) -> bool:
        """The last scan did not show what it should have, but other things."""

    def reset(self, pose: ArrayLike, covariance: ArrayLike) -> None:
        """Go on from a pose (3,) with covariance (3, 3)."""

    def restart_clock(self) -> None:
        """Take the next stamp and odometry as they come."""

    def drive_by(self, motion: Literal["odometry", "constant velocity"]) -> None:
        """Predict by this from now on, with the pose and the map as they are."""

    def displace(self, increment: Array, covariance: Array) -> None:
        """Move by an increment (3,) seen from the sensor, with its covariance (3, 3)."""

    def step(
        self,
        observed: Points,
        stamp: float,
        odometry: ArrayLike | None,
        visible: Visible | None,
        times: Array | None,
    ) -> Estimate:
        """One scan, as in `Slam.step`."""


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
    make = KnownMap if settings.mode == "localize" else Slam
    return make(replace(settings.filter, motion=motion, settle=settle), pose, covariance, known)


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
