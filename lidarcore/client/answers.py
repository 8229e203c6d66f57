"""What the server is asked for, and what it answers."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypedDict

from lidarcore.arrays import Array


class Which(TypedDict, total=False):
    """Which landmarks count: of a kind or some, found by a method or some, seen since and until (s), and so on."""

    kind: str | Sequence[str]
    method: str | Sequence[str]
    since: float
    until: float
    min_count: int
    max_sigma: float


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Where the sensor is, and what its filter thinks of itself.

    stamp       s
    pose        (3,) T_world_sensor: x m, y m, heading rad
    covariance  (3, 3) of the pose
    nis, dof    normalised innovation squared, and the degrees of freedom of its chi-square law
    """

    stamp: float
    pose: Array
    covariance: Array
    mode: Literal["localize", "slam"]
    state: Literal["starting", "tracking", "coasting", "lost"]
    message: str | None
    nis: float
    dof: int


@dataclass(frozen=True, slots=True)
class PastPose:
    """T_world_sensor as it was estimated at `stamp` (s): m, m, rad, their standard deviations and covariances."""

    stamp: float
    x: float
    y: float
    heading: float
    sigma_x: float
    sigma_y: float
    sigma_heading: float
    cov_xy: float
    cov_x_heading: float
    cov_y_heading: float


@dataclass(frozen=True, slots=True, eq=False)
class SeenCorner:
    """A corner of the newest scan: (2,) m and (2, 2) m² in the sensor frame, angle rad; the id lasts between scans."""

    id: int
    xy: Array
    covariance: Array
    angle: float
