"""What a user can set about scan matching and the map made of it: declared once, with unit, range and meaning."""

from dataclasses import field
from typing import Annotated

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from lidarcore.fields import number
from lidarcore.localization.settings import OdometryNoise
from lidarcore.noise import SensorNoise

_CONFIG = ConfigDict(extra="forbid")


@dataclass(config=_CONFIG, frozen=True, slots=True, kw_only=True)
class MatchSettings:
    """How two scans are laid on each other. Immutable; pydantic.ValidationError names a wrong field."""

    noise: SensorNoise = field(default_factory=SensorNoise)
    radius: Annotated[
        float, number(0.02, 2, "m", "points this near on the same surface make the line of a point")
    ] = 0.3
    gap: Annotated[
        float, number(0.02, 5, "m", "a surface ends where neighbouring points are farther apart")
    ] = 0.5
    reach: Annotated[
        float, number(0.02, 2, "m", "farthest point of the reference that a point is taken for")
    ] = 0.3
    cell: Annotated[float, number(0.01, 0.5, "m", "grid in which the coarse match is sought")] = 0.05
    blur: Annotated[float, number(0.01, 1, "m", "by which the coarse match blurs the reference")] = 0.1
    horizon: Annotated[float, number(1, 50, "m", "the coarse match leaves out what is farther away")] = 12.0
    max_shift: Annotated[float, number(0, 10, "m", "the coarse match never looks farther than this")] = 3.0
    max_turn: Annotated[float, number(0, 3.15, "rad", "the coarse match never turns by more than this")] = 0.8


@dataclass(config=_CONFIG, frozen=True, slots=True, kw_only=True)
class LoopSettings:
    """When a scan is tied to an earlier place."""

    distance: Annotated[float, number(0.5, 30, "m", "earlier places this near are looked at")] = 4.0
    places: Annotated[
        int, Field(ge=1, le=50, description="passes that one scan is matched with, at most")
    ] = 4
    overlap: Annotated[
        float, number(0.1, 1, "", "share of the scan that the earlier one should have seen")
    ] = 0.4
    inliers: Annotated[float, number(0.1, 1, "", "share of the scan that must lie on the earlier one")] = 0.4
    conflicts: Annotated[
        float, number(0, 1, "", "share of the scan that may lie where the earlier one looked through")
    ] = 0.1
    gate: Annotated[
        float, number(0.5, 0.99999, "", "share of the true loops that the chi-square gate lets through")
    ] = 0.999
    support: Annotated[
        int,
        Field(ge=2, le=20, description="loops that must agree where the map alone is too vague to judge one"),
    ] = 3
    memory: Annotated[
        int, Field(ge=1, le=100, description="keyframes for which a loop waits for others to agree with")
    ] = 10


@dataclass(config=_CONFIG, frozen=True, slots=True, kw_only=True)
class ScanSlamSettings:
    """How scans become a pose graph."""

    match: MatchSettings = field(default_factory=MatchSettings)
    loops: LoopSettings = field(default_factory=LoopSettings)
    odometry: OdometryNoise = field(
        default_factory=lambda: OdometryNoise(
            along=0.1, across=0.1, heading_per_metre=0.1, heading_per_radian=0.15, slip_per_radian=0.05
        )
    )
    speed_change: Annotated[
        float, number(0.01, 50, "m/s", "standard deviation of the speed's change between two scans")
    ] = 0.5
    turn_change: Annotated[
        float, number(0.01, 50, "rad/s", "standard deviation of the turn rate's change between two scans")
    ] = 1.0
    keyframe_distance: Annotated[float, number(0, 10, "m", "a scan this far from the last node is one")] = 0.3
    keyframe_turn: Annotated[float, number(0, 3.15, "rad", "a scan turned this much is a node")] = 0.25
    inliers: Annotated[
        float, number(0.05, 1, "", "share of a scan that must lie on the last keyframe to be tied to it")
    ] = 0.15
    max_step: Annotated[
        float, number(0.1, 100, "m", "odometry that moves farther between scans has jumped")
    ] = 5.0
