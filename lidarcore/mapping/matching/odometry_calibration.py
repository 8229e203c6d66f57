"""What odometry does wrong in the same way at every step, learned from where scans show how far it was.

Errors of wheels that are a little too large or unequal do not average out: 3 % of a corridor of 200 m in which nothing
tells how far one went are 6 m, where a random walk of 10 cm a metre makes 1.4 m [Borenstein & Feng, T-RA 1996; learned
on the way as by Kümmerle et al., Auton. Robots 2011].
"""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import UncertainPose, squared_mahalanobis
from lidarcore.mapping.doubt import DOUBTFUL

_USUAL = np.array([0.05, 0.05, 0.1])  # standard deviations among robots, in the order of the errors


class OdometryCalibration:
    """Estimates three errors: of the way, as a share; of the heading, in rad a metre; of turns, as a share."""

    def __init__(self) -> None:
        self._errors = np.zeros(3)
        self._information = np.diag(_USUAL**-2.0)

    @property
    def errors(self) -> Array:
        """(3,) as far as they are known now."""
        return self._errors.copy()

    def corrected(self, motion: Array) -> Array:
        """A motion (3,) m, m, rad that odometry tells, without what it does wrong as far as that is known."""
        better: Array = motion + effects(motion) @ self._errors
        return better

    def learn(self, moved: UncertainPose, found: UncertainPose) -> None:
        """From a corrected motion, with what it is unsure by at random, and that motion after scans were matched.

        With the random part M of `moved`, covariance C of `found` and information H of the matches, C^-1 is M^-1 + H,
        so that the matches measure the motion of wheels with covariance H^-1 + M, the inverse of M^-1 - M^-1 C M^-1.
        Where they say nothing, as along a corridor, C is M and nothing is learned.
        """
        off = found.pose - moved.pose
        if squared_mahalanobis(off, moved.covariance) > DOUBTFUL:
            return  # wheels slip
        # Of the motion that was found: the noise of `moved` is in the difference, too, and would bias the way.
        J, M = effects(found.pose), np.linalg.inv(moved.covariance)
        self._information += J.T @ (M - M @ found.covariance @ M) @ J
        self._errors += np.linalg.solve(self._information, J.T @ M @ off)


def effects(motion: Array) -> Array:
    """(3, 3) by how much each error, were it 1, makes a motion (3,) m, m, rad too short."""
    x, y, turn = motion
    return np.array([[x, 0, 0], [y, 0, 0], [0, np.hypot(x, y), turn]])
