"""What navigation says after each scan: the result, and the messages in it."""

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.errors import LocalizationError
from lidarcore.localization.ekf.estimate import Estimate
from lidarcore.localization.landmarks import Landmarks
from lidarcore.localization.points import Points

State = Literal["starting", "tracking", "coasting", "lost"]


@dataclass(frozen=True, slots=True, eq=False)
class TrackingResult:
    """Where the sensor is after one scan, what it saw, and the map.

    stamp          s, of the scan
    mode           whether the map is known or made
    state          starting: no pose, or no confirmed landmark yet; coasting: nothing matched, the pose is predicted;
                   lost: the pose is unknown, and searched for in the map
    message        what is wrong, in a sentence, or None
    estimate       pose T_world_sensor with covariance, velocity, innovation; the last one if the scan was left out
    observed       points seen, sensor frame, in the indices of the association
    landmarks      after this scan
    pairs          (P, 2) index in observed and id of the landmark, of pairs used for the pose
    tentative      (T, 2) of pairs with tentative landmarks, not used for the pose
    ambiguous      (A, 2) of pairs with a rival almost as likely, not used
    unmatched      (U,) observed without a landmark
    dead_reckoned  (3,) by odometry alone from where the sensor started or was placed; None without odometry
    removed        (R,) ids of landmarks dropped or merged into another
    """

    stamp: float
    mode: Literal["localize", "slam"]
    state: State
    message: str | None
    estimate: Estimate
    observed: Points
    landmarks: Landmarks
    pairs: Ints
    tentative: Ints
    ambiguous: Ints
    unmatched: Ints
    dead_reckoned: Array | None
    removed: Ints

    @classmethod
    def of(
        cls,
        stamp: float,
        mode: Literal["localize", "slam"],
        state: State,
        message: str | None,
        estimate: Estimate,
        observed: Points,
        before: Landmarks,
        after: Landmarks,
        dead_reckoned: Array | None,
    ) -> Self:
        """The result from the map before the scan, to which the association refers, and from the map after it."""
        association = estimate.association
        used = np.stack([association.observed, association.landmark], -1)
        return cls(
            stamp,
            mode,
            state,
            message,
            estimate,
            observed,
            after,
            pairs=_with_ids(used, before),
            tentative=_with_ids(association.tentative, before),
            ambiguous=_with_ids(association.ambiguous, before),
            unmatched=np.sort(np.concatenate([association.unmatched, association.new])),
            dead_reckoned=dead_reckoned,
            removed=np.setdiff1d(before.ids, after.ids),
        )

    @property
    def nis(self) -> float:
        """Normalised innovation squared of the pairs used."""
        return self.estimate.innovation.nis

    @property
    def dof(self) -> int:
        """Degrees of freedom of the chi-square law that `nis` follows if the filter is honest: 2 P."""
        return 2 * len(self.pairs)


def _with_ids(pairs: Ints, landmarks: Landmarks) -> Ints:
    """Pairs (P, 2) with the ids of the landmarks in place of their indices."""
    return np.stack([pairs[:, 0], landmarks.ids[pairs[:, 1]]], -1)


NO_ODOMETRY = "No odometry arrives: the pose is predicted at constant velocity."
NEW_MAP = "Too few landmarks were known to recover the pose: a new map was started."
STATE_MESSAGES: dict[State, str] = {
    "coasting": "No landmark was recognised: the pose is only predicted.",
    "lost": "The pose is lost: searching for it in the map.",
}


def left_out(error: LocalizationError) -> str:
    """Why a scan is not used."""
    return f"{_fact(error)}: the scan was skipped."


def goes_on(error: LocalizationError) -> str:
    """What broke, and is over."""
    return f"{_fact(error)}: tracking continues from the new values."


def _fact(error: LocalizationError) -> str:
    """What was found, without what a caller of the filter could do about it."""
    return str(error).partition(":")[0]
