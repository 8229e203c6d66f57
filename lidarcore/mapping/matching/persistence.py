"""How a sensor without odometry is taken to go on: as it went before; and how far that may lead astray."""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import kernel
from lidarcore.geometry import UncertainPose, relative
from lidarcore.geometry.kernels import compose_with_jacobians, turned_back

_NOTHING = np.zeros((3, 3))


class _Told(NamedTuple):
    """What a match tells: where a scan was found (3,), where the one before it had been known to be, the covariances
    (3, 3) of both and of the guess, and that of how a step may differ from the one before."""

    known: Array
    known_covariance: Array
    guess_covariance: Array
    found: Array
    found_covariance: Array
    change: Array


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
        told = _Told(known.pose, known.covariance, guess.covariance, found.pose, found.covariance, change)
        self.astray, self._shared, self._covariance = _went_on(
            self.step, self.astray, self.longer, self._shared, self._covariance, told
        )
        self.step = relative(known.pose, found.pose)

    def stop(self) -> None:
        """Nothing tells that it goes on: it may as well have stopped."""
        self._covariance = self._covariance + np.outer(self.step, self.step)
        self.step = np.zeros(3)


@kernel
def _went_on(
    step: Array, astray: Array, longer: Array, shared: Array, covariance: Array, told: _Told
) -> tuple[Array, Array, Array]:
    """What is unsure after a step (3,): of the pose, of the next step for what it shares with that, and by itself."""
    _, by_pose, by_step = compose_with_jacobians(told.known, step)
    to_sensor = turned_back(told.found[2])
    untold = _untold(told.guess_covariance, told.found_covariance)
    seen = _within(np.eye(3) - untold, told.found_covariance + told.known_covariance)
    astray = _within(untold @ by_pose, astray) + _within(untold @ by_step, longer)
    gone_on = to_sensor @ untold @ by_step
    shared = _within(gone_on, shared + covariance + told.change)
    return astray, shared, _within(gone_on, covariance + told.change) + _within(to_sensor, seen)


@kernel
def _untold(guess: Array, found: Array) -> Array:
    """(3, 3) that takes of an error of the guess what stays of it, from the covariances of guess and match.

    All of it in directions of which the match says nothing; never more, though a guess that is far off counts less.
    """
    L = np.linalg.cholesky(guess)
    back = np.linalg.inv(L)
    stays, V = np.linalg.eigh(back @ found @ back.T)
    return L @ (V * np.clip(stays, 0.0, 1.0)) @ V.T @ back


@kernel
def _within(J: Array, covariance: Array) -> Array:
    """J P J^T."""
    return (J @ covariance @ J.T).astype(np.float64)
