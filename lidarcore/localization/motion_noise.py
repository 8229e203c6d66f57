"""How far the motion between scans may be off: the noise of odometry, and of a velocity that is taken as constant."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.fields import number, settings
from lidarcore.localization.ekf.motion_kernels import odometry_variances


@settings
class OdometryNoise:
    """Random walk of odometry: variances grow with the way and the turn, however finely they are cut into steps."""

    along: float = number(
        1e-4,
        1,
        "m/√m",
        "standard deviation ahead after one metre. "
        "More: scans correct the distance that odometry reports by more",
        default=0.03,
    )
    across: float = number(
        1e-4,
        1,
        "m/√m",
        "standard deviation sideways after one metre. More: scans correct sideways slip by more",
        default=0.01,
    )
    heading_per_metre: float = number(
        1e-4,
        1,
        "rad/√m",
        "standard deviation of the heading after one metre. "
        "More: scans correct the heading on straight stretches by more",
        default=0.02,
    )
    heading_per_radian: float = number(
        1e-4,
        1,
        "rad/√rad",
        "standard deviation of the heading after turning one radian. More: scans correct turns by more",
        default=0.05,
    )
    slip_per_radian: float = number(
        0,
        1,
        "m/√rad",
        "standard deviation of the position after turning one radian. "
        "More: scans correct the position after turns by more",
        default=0.01,
    )
    unseen: float = number(
        0,
        1,
        "m/√s",
        "drift of the position per root second that odometry does not report. "
        "More: the position grows vague sooner at rest",
        default=0.002,
    )
    unseen_turn: float = number(
        0,
        1,
        "rad/√s",
        "drift of the heading per root second that odometry does not report. "
        "More: the heading grows vague sooner at rest",
        default=0.002,
    )

    @property
    def table(self) -> Array:
        """(7,) the numbers as kernels take them."""
        ways = [
            self.along,
            self.across,
            self.heading_per_metre,
            self.heading_per_radian,
            self.slip_per_radian,
        ]
        return np.array([*ways, self.unseen, self.unseen_turn])

    def covariance(self, increment: Array, dt: float = 0.0) -> Array:
        """Covariance (3, 3) of an increment (3,) m, m, rad over dt s, in the sensor frame before the step."""
        return np.diag(odometry_variances(np.asarray(increment, np.float64), dt, self.table))


@settings
class VelocityNoise:
    """White accelerations of the constant-velocity model."""

    acceleration: float = number(
        1e-4,
        50,
        "m/s/√s",
        "change of the speed within a second. "
        "More: faster starts and stops are followed, and the pose is vaguer between scans",
        default=0.5,
    )
    sideways: float = number(
        0,
        50,
        "m/s/√s",
        "change of the speed sideways within a second; 0 if it never slides. More: it may slide faster",
        default=0.5,
    )
    turn_acceleration: float = number(
        1e-4,
        50,
        "rad/s/√s",
        "change of the turn rate within a second. "
        "More: faster turns are followed, and the heading is vaguer between scans",
        default=1.0,
    )
    speed: float = number(
        1e-3,
        50,
        "m/s",
        "standard deviation of the speed at the start. More: a start in motion is followed",
        default=1.0,
    )
    turn_rate: float = number(
        1e-3,
        50,
        "rad/s",
        "standard deviation of the turn rate at the start. More: a start in a turn is followed",
        default=1.0,
    )
