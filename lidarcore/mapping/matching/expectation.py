"""Where a scan should lie on a map, before it is looked at, and what it costs that it lies elsewhere."""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import UncertainPose, pose_difference
from lidarcore.mapping.doubt import DOUBTFUL, loss
from lidarcore.mapping.matching.correlative import arm
from lidarcore.mapping.matching.registration import Registration, information_of

_WIDE = 0.5  # m by which a point may be off where the guess is vague


class Expectation(NamedTuple):
    """A guess of the pose of a scan.

    pose         (3,) T_map_scan
    sigma        (3,) its standard deviations
    information  (3, 3) inverse of its covariance
    """

    pose: Array
    sigma: Array
    information: Array

    def contradiction(self, pose: Array) -> float:
        """Squared Mahalanobis distance of a pose (3,) from it."""
        off = pose_difference(pose, self.pose)
        return float(off @ self.information @ off)

    def cost(self, pose: Array) -> float:
        """What it costs that a pose (3,) contradicts it."""
        return float(loss(self.contradiction(pose), DOUBTFUL))

    def worth(self, registered: Registration, n: int) -> float:
        """Log-likelihood of a pose: one for each of n patches that fits, as in the search, less what it costs."""
        return n * registered.inliers - self.cost(registered.pose) / 2

    def likelihood(self, other: Registration, best: Registration, n: int) -> float:
        """Of another pose of n patches, if it fits worse than the best one by chance: beside 1 for the best one."""
        less = max(best.inliers - other.inliers, 0.0)
        variance = (2 - best.inliers - other.inliers) / n  # of two shares; of none where both are whole
        worse = less**2 / variance if less > 0 else 0.0
        farther = max(self.cost(other.pose) - self.cost(best.pose), 0.0)
        return float(np.exp(-(worse + farther) / 2))

    def leaves_open(self, places: Array) -> bool:
        """Whether it may put points (N, 2) of the scan far from where they are."""
        far = arm(places) if len(places) else 0.0
        return bool(3 * (np.hypot(self.sigma[0], self.sigma[1]) + far * self.sigma[2]) > _WIDE)


def expectation(guess: UncertainPose) -> Expectation:
    """That of a pose with its covariance."""
    P = guess.covariance
    return Expectation(guess.pose, np.sqrt(np.diagonal(P)), information_of(P))
