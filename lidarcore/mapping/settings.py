"""What a user can set about scan matching and the map made of it: declared once, with unit, range and meaning."""

from dataclasses import field, replace

import numpy as np

from lidarcore.arrays import Array
from lidarcore.fields import number, settings, whole
from lidarcore.localization.motion_noise import OdometryNoise
from lidarcore.noise import SensorNoise

VAGUE = 0.5
"""rad: where a heading is known no better than this, what a sensor should see cannot be told."""


@settings
class MatchSettings:
    """How two scans are matched to each other. Immutable; pydantic.ValidationError names a wrong field."""

    noise: SensorNoise = field(default_factory=SensorNoise)
    radius: float = number(
        0.02, 2, "m", "points this near on the same surface make the line of a point", default=0.3
    )
    gap: float = number(
        0.02, 5, "m", "a surface ends where neighbouring points are farther apart", default=0.5
    )
    patch: float = number(
        0.01, 1, "m", "length of the patches that a scan's surfaces are cut into", default=0.1
    )
    unevenness: float = number(
        0, 0.2, "m", "standard deviation of a patch from where its wall is, beside noise", default=0.005
    )
    reach: float = number(
        0.02, 2, "m", "farthest point of the reference that a point is taken for", default=0.3
    )
    cell: float = number(0.01, 0.5, "m", "grid in which the coarse match is sought", default=0.05)
    blur: float = number(0.01, 1, "m", "by which the coarse match blurs the reference", default=0.1)
    horizon: float = number(
        1,
        50,
        "m",
        "the coarse match leaves out what is farther away, unless most is",
        default=12.0,
    )
    max_shift: float = number(0, 30, "m", "the coarse match never looks farther than this", default=10.0)
    max_turn: float = number(0, 3.15, "rad", "the coarse match never turns by more than this", default=3.15)


@settings
class FrontSettings:
    """How a scan is matched to the local map, and which scans make it."""

    match: MatchSettings = field(default_factory=MatchSettings)
    odometry: OdometryNoise = field(
        default_factory=lambda: OdometryNoise(
            along=0.1, across=0.1, heading_per_metre=0.1, heading_per_radian=0.15, slip_per_radian=0.05
        )
    )
    speed_change: float = number(
        0.01,
        50,
        "m/s",
        "standard deviation of the speed's change between two scans, a second apart",
        default=0.5,
    )
    turn_change: float = number(
        0.01, 50, "rad/s", "standard deviation of the turn rate's change, the same", default=1.0
    )
    keyframe_distance: float = number(
        0, 10, "m", "a scan this far from the last keyframe is one", default=0.3
    )
    keyframe_turn: float = number(0, 3.15, "rad", "a scan turned this much is a keyframe", default=0.26)
    standing: float = number(
        0.01, 1e6, "s", "while the sensor stands, the map takes a scan this often", default=1.0
    )
    keyframes: int = whole(1, 100, "last keyframes that make the local map", default=10)
    inliers: float = number(
        0.05, 1, "", "share of a scan that must lie on the local map to be tied to it", default=0.15
    )
    max_step: float = number(
        0.1,
        100,
        "m",
        "odometry that moves farther within a second, or from scan to scan, has jumped",
        default=5.0,
    )


@settings
class LoopSettings:
    """When a scan is tied to an earlier place."""

    distance: float = number(0.5, 30, "m", "earlier places this near are looked at", default=4.0)
    sigmas: float = number(
        0, 10, "", "standard deviations by which places may be farther, and stretches longer", default=2.5
    )
    farthest: float = number(1, 100, "m", "no earlier place is farther than this", default=20.0)
    apart: int = whole(1, 1000, "keyframes between two that make a loop", default=10)
    before: int = whole(0, 20, "keyframes before one that are matched with it", default=4)
    places: int = whole(1, 50, "passes that one scan is matched with, at most", default=4)
    overlap: float = number(
        0.1, 1, "", "share of the scan that the earlier one should have seen", default=0.4
    )
    inliers: float = number(0.1, 1, "", "share of the scan that must lie on the earlier one", default=0.5)
    conflicts: float = number(
        0, 1, "", "share of either scan that may lie where the other one looked through", default=0.1
    )
    gate: float = number(
        0.5, 0.99999, "", "share of the true loops that the chi-square gate lets through", default=0.999
    )
    floor_distance: float = number(1e-4, 1, "m", "no loop is known better than this", default=0.01)
    floor_turn: float = number(1e-5, 1, "rad", "no loop is known better than this", default=0.003)
    support: int = whole(
        2, 20, "nodes with loops that agree where the map is too vague to judge one", default=3
    )
    shortest: float = number(0, 100, "m", "way along which such loops agree, at least", default=3.0)
    longest: float = number(0, 100, "m", "way that is enough however vague the map is", default=12.0)
    rivals: float = number(
        0, 1, "", "share of their support that loops which contradict them may have", default=0.7
    )
    memory: float = number(1, 1000, "m", "way for which a loop waits for others to agree with", default=20.0)

    @property
    def floor(self) -> Array:
        """Covariance (3, 3) that every loop has at least."""
        return np.diag([self.floor_distance, self.floor_distance, self.floor_turn]) ** 2

    @property
    def stretch(self) -> tuple[float, float]:
        """Shortest and longest way in m along which vague loops must agree."""
        return self.shortest, self.longest


@settings
class MapperSettings:
    """How scans become a map."""

    front: FrontSettings = field(default_factory=FrontSettings)
    loops: LoopSettings = field(default_factory=LoopSettings)
    cell: float = number(
        0.1, 5, "m", "length of the surfaces that are taken for straight when a map is finished", default=0.5
    )
    drift: float = number(
        0, 1, "m", "standard deviation that a step from keyframe to keyframe has beside noise", default=0.01
    )
    drift_turn: float = number(0, 1, "rad", "the same of its heading", default=0.002)

    @property
    def drift_covariance(self) -> Array:
        """Covariance (3, 3) that a step from keyframe to keyframe has beside noise."""
        return np.diag([self.drift, self.drift, self.drift_turn]) ** 2

    def with_noise(self, noise: SensorNoise) -> "MapperSettings":
        """These settings for a sensor of that noise."""
        match = replace(self.front.match, noise=noise)
        return replace(self, front=replace(self.front, match=match))
