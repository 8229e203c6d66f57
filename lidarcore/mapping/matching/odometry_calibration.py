"""What odometry does wrong in the same way at every step, learned from where scans show how far it was.

Errors of wheels that are a little too large or unequal do not average out: 3 % of a corridor of 200 m in which nothing
tells how far one went are 6 m, where a random walk of 10 cm a metre makes 1.4 m [Borenstein & Feng, T-RA 1996; learned
on the way as by Kümmerle et al., Auton. Robots 2011].
"""

from math import cos, hypot, sin
from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import UncertainPose, squared_mahalanobis
from lidarcore.mapping.doubt import DOUBTFUL

_USUAL = np.array([0.05, 0.05, 0.1, 0.1])  # standard deviations among robots, in the order of the errors


class Taken(NamedTuple):
    """What was taken out of a motion that odometry told: errors (4,), times their effects (3, 4) on it."""

    errors: Array
    effects: Array


class OdometryCalibration:
    """Estimates four errors: of the way, as a share; of the heading, in rad a metre; of turns, as a share; time, in s.

    The last is how far odometry is ahead of the scans: a scan is stamped when it has come, or encoders are read late.
    In public logs of four robots this is -0.2 to 0.2 s, at which a robot that begins to turn seems to slip.
    """

    def __init__(self) -> None:
        self._errors = np.zeros(4)
        self._information = np.diag(_USUAL**-2.0)
        self._ahead_variance = _USUAL[3] ** 2

    @property
    def errors(self) -> Array:
        """(4,) as far as they are known now."""
        return self._errors.copy()

    def corrected(self, motion: Array, before: Array, after: Array) -> Array:
        """A motion (3,) m, m, rad that odometry tells, without what it does wrong as far as that is known.

        before, after (3,) m/s, m/s, rad/s where it begins and where it ends.
        """
        better: Array = motion + effects(motion, before, after) @ self._errors
        return better

    def unknown(self, motion: Array, before: Array, after: Array) -> Array:
        """(3, 3) of such a motion, by how far odometry may still be ahead: its noise, of the way, has nothing of that.

        After the first turns it is known, and little is left.
        """
        ahead = effects(motion, before, after)[:, 3]
        return self._ahead_variance * np.outer(ahead, ahead)

    def learn(self, moved: UncertainPose, found: UncertainPose, before: Array, after: Array) -> None:
        """From a corrected motion, with what it is unsure by at random, and that motion after scans were matched.

        With the random part M of `moved`, covariance C of `found` and information H of the matches, C^-1 is M^-1 + H,
        so that the matches measure the motion of wheels with covariance H^-1 + M, the inverse of M^-1 - M^-1 C M^-1.
        Where they say nothing, as along a corridor, C is M and nothing is learned.
        """
        off = found.pose - moved.pose
        if squared_mahalanobis(off, moved.covariance) > DOUBTFUL:
            return  # wheels slip
        # Of the motion that was found: the noise of `moved` is in the difference, too, and would bias the way.
        J, M = effects(found.pose, before, after), np.linalg.inv(moved.covariance)
        self._information += J.T @ (M - M @ found.covariance @ M) @ J
        P = np.linalg.inv(self._information)
        self._errors += P @ J.T @ M @ off
        self._ahead_variance = P[3, 3]


def effects(motion: Array, before: Array, after: Array) -> Array:
    """(3, 4) by how much each error, were it 1, makes a motion (3,) m, m, rad too short.

    before, after (3,) m/s, m/s, rad/s where it begins and ends: what is ahead by a second lacks the second before the
    motion, and has the one after it instead.
    """
    (x, y, turn), (u, v, w), (u_after, v_after, w_after) = motion.tolist(), before.tolist(), after.tolist()
    c, s = cos(turn), sin(turn)
    return np.array([
        [x, 0, 0, u - w * y - (c * u_after - s * v_after)],
        [y, 0, 0, v + w * x - (s * u_after + c * v_after)],
        [0, hypot(x, y), turn, w - w_after],
    ])  # fmt: skip
