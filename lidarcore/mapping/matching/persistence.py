"""How a sensor without odometry is taken to go on: as it went before; and how far that may lead astray."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import kernel
from lidarcore.geometry import UncertainPose, compose_jacobians, relative, relative_jacobians

_NOTHING = np.zeros((3, 3))
_ALL = np.eye(3)


class Persistence:
    """The motion from one scan to the next, if it goes on.

    Where scans tell the motion, each step is told anew. Where they do not, as along the bare walls of a corridor, the
    error of the last step that was told is made again at every step: not its square adds up, but itself. A search that
    looked as far as that would find something anywhere; so this is claimed, not searched.

    step      (3,) from the scan before to the last one
    longer    (3, 3) by how much more the next step may be wrong than the change of a speed makes it
    astray    (3, 3) by how much more the pose of the last scan may be wrong than a match with that guess says
    """

    def __init__(self) -> None:
        self.step = np.zeros(3)
        self.astray = _NOTHING
        self._covariance = self._shared = _NOTHING  # of the step, and with what it has led astray already

    @property
    def longer(self) -> Array:
        """As said of the class."""
        return self._covariance + 2 * self._shared

    def begin(self, step: Array, covariance: Array = _NOTHING) -> None:
        """The last step (3,) is known that well."""
        self.step, self._covariance, self._shared = step, covariance, _NOTHING

    def leave(self) -> None:
        """What follows is seen from the last scan."""
        self.astray = _NOTHING

    def find(self, known: UncertainPose, guess: UncertainPose, found: UncertainPose, change: Array) -> None:
        """A scan was found there, seen from a keyframe, where it had been known and guessed to be.

        change (3, 3) of the step, by which speeds may have changed since the one before.
        """
        by_pose, by_step = compose_jacobians(known.pose, self.step)
        to_sensor = relative_jacobians(found.pose, found.pose)[1]
        untold = _untold(guess.covariance, found.covariance)
        told = _within(_ALL - untold, found.covariance + known.covariance)
        self.astray = _within(untold @ by_pose, self.astray) + _within(untold @ by_step, self.longer)
        gone_on = to_sensor @ untold @ by_step
        self._shared = _within(gone_on, self._shared + self._covariance + change)
        self._covariance = _within(gone_on, self._covariance + change) + _within(to_sensor, told)
        self.step = relative(known.pose, found.pose)

    def stop(self) -> None:
        """Nothing tells that it goes on: it may as well have stopped."""
        self._covariance = self._covariance + np.outer(self.step, self.step)
        self.step = np.zeros(3)


@kernel
def _untold(guess: Array, found: Array) -> Array:
    """(3, 3) that takes of an error of the guess what stays of it, from the covariances of guess and match.

    All of it in directions of which the match says nothing; never more, though a guess that is far off counts less.
    """
    L = np.linalg.cholesky(guess)
    back = np.linalg.inv(L)
    stays, V = np.linalg.eigh(back @ found @ back.T)
    return L @ (V * np.clip(stays, 0.0, 1.0)) @ V.T @ back


def _within(J: Array, covariance: Array) -> Array:
    """J P J^T."""
    carried: Array = J @ covariance @ J.T
    return carried
