"""Speeds and accelerations told by places around a time, where nobody knows how jerkily a sensor is driven.

Accelerations wander: the jerk is white noise, of a density that the places themselves tell, one near the time and one
farther away, as a drive that was steady for long may just now become jerky, or have one jolt
[Rasmussen & Williams, Gaussian Processes, 2006, eq. 2.23 and 5.8].
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.mapping.matching.jerk_fits import Densities, Window, evidences, mix
from lidarcore.mapping.matching.white_jerk import STRETCHES, wander

JERKS = np.array([0.001, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0])[:, None] * [1.0, 1.0, 2.0]
"""What may change an acceleration within a second, from the steadiest drive to the jerkiest: m/s², m/s², rad/s²."""
STEADY = np.repeat(JERKS[:, None], STRETCHES, axis=1)
"""Densities (9, 5, 3), the same in all stretches of time."""


def _densities() -> Array:
    """Of the stretches near the time, all are otherwise than the far one, or one alone is jerkier: there is a jolt."""
    near = [[far, *[other] * (STRETCHES - 1)] for far in JERKS for other in JERKS]
    jolts = [
        [other if stretch == jolt else far for stretch in range(STRETCHES)]
        for far, other in combinations(JERKS, 2)
        for jolt in range(1, STRETCHES)
    ]
    return np.array(near + jolts)


DENSITIES = _densities()
"""Densities (225, 5, 3) in the stretches of time around a sweep, that a drive may have."""
_NOISES = 2.0 ** np.arange(3, -8, -0.5)
"""Times the variances of places, which their noise may really have."""
_ENOUGH = 300  # times that tell the noise
_RAREST = 1e-9  # share of a density, at least: no drive is so long that it rules one out
_NEVER = 1e-6  # share of a density below which it explains nothing
_SETTLED = 0.003  # share by which no density explains places better than all together: no other shares do
_ROUNDS = 1000  # of expectation maximisation, at most
_SHORTEST = 1e-8  # s that half a sweep takes, where it is taken at once


def window(told: Bools, t: Array, h: Array, places: Array, variances: Array, speeds: Array) -> Window:
    """Of places (T, K, 3) around t (T, K) s, each the mean over h (T,) s before and after; some may not be told.

    speeds (T, 2, 3) are those at the times, with their variances.
    """
    h, own = np.maximum(h, _SHORTEST), np.argmax(t == 0, axis=1)
    exist = np.concatenate([told, np.ones((len(t), 2), np.bool_)], 1)
    t = np.where(told, t, 0.0)
    mean = np.stack([np.ones_like(t), t, t**2 / 2 + h[:, None] ** 2 / 6], -1) * told[..., None]
    basis = np.concatenate([mean, np.broadcast_to([[[0.0, 1.0, 0.0]]], (len(t), 1, 3))], 1)
    noise = np.where(told[..., None], variances, 1.0)
    added = np.empty((len(t), STRETCHES, t.shape[1] + 2, t.shape[1] + 2))
    wander(t, h, added)
    both = exist[:, None, :, None] & exist[:, None, None, :]
    given = np.concatenate([np.where(told[..., None], places, 0.0), speeds[:, :1]], 1)
    return Window(
        basis,
        np.swapaxes(np.concatenate([noise, np.zeros((len(t), 1, 3))], 1), 1, 2).copy(),
        np.swapaxes(np.concatenate([np.zeros(noise.shape), speeds[:, 1:]], 1), 1, 2).copy(),
        np.where(both, added, 0.0),
        np.swapaxes(given, 1, 2).copy(),
        own,
    )


class Drive(NamedTuple):
    """What the places of a whole drive say of it.

    noise      times the variances of the places, which is what explains them best: poses of scans on one map share its
               errors, which are no noise from one to the next; one factor, as the same surfaces tell all dimensions
    densities  (D, 5, 3) of the jerk, those that explain any of the places
    shares     (D, 3) how often each of these explains them best
    """

    noise: float
    densities: Array
    shares: Array

    @classmethod
    def of(cls, given: Window) -> "Drive":
        """By some of its times, maximum likelihood of noise and jerk: one of them alone takes the other's place."""
        some = np.arange(0, len(given.told), -(-len(given.told) // _ENOUGH))
        likelihoods = [_most_likely(given, some, noise, STEADY)[0] for noise in _NOISES]
        noise = float(_NOISES[int(np.argmax(likelihoods))])
        shares = _most_likely(given, some, noise, DENSITIES)[1]
        # Of drives that are looked at in part, the rest may be jerkier still: the steady densities stay.
        counts = (shares > _NEVER).any(axis=1) | (DENSITIES[:, :1] == DENSITIES).all(axis=(1, 2))
        return cls(noise, DENSITIES[counts], shares[counts])


def _most_likely(given: Window, some: Ints, noise: float, jerks: Array) -> tuple[float, Array]:
    """Log-likelihood of `noise` times the variances at some of the times, with the shares (D, 3) of densities that make
    it largest."""
    found = np.empty((len(jerks), len(some), 3))
    evidences(given, some, noise, jerks, found)
    highest = found.max(axis=0)
    likelihoods, shares = np.exp(found - highest), np.full((len(jerks), 3), 1 / len(jerks))
    for _ in range(_ROUNDS):
        mixed = np.einsum("nsd,nd->sd", likelihoods, shares)
        gains = np.einsum("nsd,sd->nd", likelihoods, 1 / mixed) / len(some)
        if gains.max() < 1 + _SETTLED:
            break
        shares = np.maximum(shares * gains, _RAREST)
    return float((highest + np.log(mixed)).sum()), shares


def estimated(given: Window, drive: Drive) -> tuple[Array, Array, Array]:
    """Speeds and accelerations (T, 2, 3) with covariances (T, 3, 2, 2): each jerk counts as it explains the places.

    The acceleration is the one with which the sweep would begin where it began, seen from its mean place. The third,
    (T, 2, 3), are their covariances with the error of the place at the time itself.
    """
    T = len(given.told)
    rates, shared, spread = np.empty((T, 2, 3)), np.empty((T, 2, 3)), np.empty((T, 3, 2, 2))
    mix(given, drive.noise, Densities(drive.densities, np.log(drive.shares)), rates, spread, shared)
    return rates, spread, shared
