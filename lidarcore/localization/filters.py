"""What the filters have in common that a Navigator drives."""

from dataclasses import replace
from typing import Literal, Protocol

from numpy.typing import ArrayLike

from lidarcore.localization.estimate import Estimate
from lidarcore.localization.known_map import KnownMap
from lidarcore.localization.landmarks import Landmarks
from lidarcore.localization.points import Points
from lidarcore.localization.settings import LocalizationSettings, NavigationSettings
from lidarcore.localization.slam import Slam, Visible
from lidarcore.scan import Array

_REST = 5.0  # s; people who stand are clusters, and seldom stand longer


class Filter(Protocol):
    """Slam, or KnownMap with the same interface."""

    @property
    def settings(self) -> LocalizationSettings:
        """With the motion model in use."""

    @property
    def map(self) -> Landmarks:
        """As it is now."""

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
        """As Slam.step."""


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
