"""What a filter says after each scan: innovation and estimate; and the instants between which it moves."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array, Ints
from lidarcore.errors import LocalizationError, MotionError
from lidarcore.geometry import chi_square_gate, relative, wrap
from lidarcore.geometry.kernels import squared_mahalanobis
from lidarcore.localization.ekf.association import Association, worst_pair
from lidarcore.localization.settings import LocalizationSettings


@dataclass(frozen=True, slots=True, eq=False)
class Innovation:
    """Observed minus predicted position of the pairs of an association.

    value       (P, 2) m, sensor frame
    covariance  (2 P, 2 P) m² of the values in one row, S
    """

    association: Association
    value: Array
    covariance: Array

    @property
    def nis(self) -> float:
        """nu^T S^-1 nu: chi-square distributed with 2 P degrees of freedom if the filter is honest."""
        return float(squared_mahalanobis(self.value.ravel(), self.covariance))

    def doubted(self) -> "Innovation":
        """This innovation without any of its pairs, as they may be chance."""
        return Innovation(self.association.doubted(), np.empty((0, 2)), np.empty((0, 0)))

    def compatible(self, probability: float) -> tuple["Innovation", Ints]:
        """Leave out pairs until the others are jointly compatible; also which pairs (P,) were kept."""
        kept, innovation = np.arange(len(self.value)), self
        while (worst := innovation._worst(probability)) is not None:
            kept = np.delete(kept, worst)
            rows = (2 * kept[:, None] + [0, 1]).ravel()
            innovation = Innovation(
                innovation.association.without(worst), self.value[kept], self.covariance[np.ix_(rows, rows)]
            )
        return innovation, kept

    def _worst(self, probability: float) -> int | None:
        if self.nis <= chi_square_gate(probability, 2 * len(self.value)):  # almost always: spares the inverse
            return None
        information = np.asarray(np.linalg.inv(self.covariance), np.float64)
        return worst_pair(self.value.ravel(), information, probability)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """The pose after one scan.

    stamp       s
    pose        (3,) T_world_sensor: x m, y m, heading rad in (-pi, pi]
    covariance  (3, 3) of the pose
    velocity    (2,) m/s ahead and rad/s, or None if odometry moves the filter
    innovation  of the pairs that were used, with the association they are part of
    sideways    m/s to the left, beside the velocity ahead
    """

    stamp: float
    pose: Array
    covariance: Array
    velocity: Array | None
    innovation: Innovation
    sideways: float = 0.0

    @property
    def association(self) -> Association:
        """Which observation was taken for which landmark, and which for none."""
        return self.innovation.association

    @property
    def coasting(self) -> bool:
        """True if nothing matched: the pose is only predicted, and its covariance has grown."""
        return len(self.association.observed) == 0

    @classmethod
    def of(cls, stamp: float, state: Array, P: Array, innovation: Innovation) -> "Estimate":
        """An estimate from the state of a motion model and its covariance."""
        if len(state) == 3:
            return cls(stamp, state.copy(), P.copy(), None, innovation)
        return cls(stamp, state[:3].copy(), P[:3, :3].copy(), state[3:5].copy(), innovation, float(state[5]))

    def unmoved(self, observed: int) -> "Estimate":
        """This estimate after a scan of so many observations that was not used."""
        return replace(self, innovation=no_innovation(observed))


def no_innovation(observed: int) -> Innovation:
    """The innovation of so many observations that were not used."""
    return Innovation(Association.none(observed), np.empty((0, 2)), np.empty((0, 0)))


@dataclass(frozen=True, slots=True, eq=False)
class Instant:
    """A stamp in s, and T_odom_sensor (3,) there if a wheel says so.

    Raises LocalizationError if a number is not finite.
    """

    stamp: float
    odometry: Array | None = None

    def __post_init__(self) -> None:
        if not np.isfinite(self.stamp):
            raise LocalizationError(f"The stamp is {self.stamp}: give seconds.")
        if self.odometry is not None:
            object.__setattr__(self, "odometry", as_pose(self.odometry, "odometry"))

    def until(self, later: "Instant", settings: LocalizationSettings) -> tuple[float, Array | None]:
        """Seconds to a later instant, and the increment (3,) that odometry gives, seen from here.

        Raises MotionError if the clock went back, or odometry is missing or moved faster than the settings allow.
        """
        dt = later.stamp - self.stamp
        if dt < 0:
            raise MotionError(
                f"The clock went back by {-dt:g} s: leave the scan out, or call restart_clock after a reset."
            )
        if settings.motion == "constant velocity":
            return dt, None
        if self.odometry is None or later.odometry is None:
            raise MotionError('The scan has no odometry: give it, or set motion to "constant velocity".')
        increment = relative(self.odometry, later.odometry)
        way, turn = float(np.hypot(*increment[:2])), abs(float(increment[2]))
        if way > settings.max_speed * dt or turn > settings.max_turn_rate * dt:
            raise MotionError(
                f"Odometry jumped by {way:.3g} m and {turn:.3g} rad in {dt:.3g} s: an encoder was reset or wrapped "
                "around. Leave the scan out, or call restart_clock to go on from the new values."
            )
        return dt, increment


def as_pose(values: ArrayLike, name: str) -> Array:
    """A pose (3,) with its heading wrapped. Raises LocalizationError if it is none."""
    pose = np.array(values, np.float64)
    if pose.shape != (3,) or not np.isfinite(pose).all():
        raise LocalizationError(f"{name} is {pose}: give x (m), y (m) and heading (rad), all finite.")
    pose[2] = wrap(pose[2])
    return pose
