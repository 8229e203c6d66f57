"""Speeds and accelerations told by places around a time, where nobody knows how jerkily a sensor is driven.

Accelerations wander: the jerk is white noise, of a density that the places themselves tell. A drive is as steady at all
times, or has a jolt once, which is as likely at any time [Rasmussen & Williams, Gaussian Processes, 2006, eq. 2.23
and 5.8].
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.mapping.motion.jerk_fits import Window, evidences, mix
from lidarcore.mapping.motion.white_jerk import STRETCHES, wander

JERKS = np.array([0.001, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0])[:, None] * [1.0, 1.0, 2.0]
"""What may change an acceleration within a second, from the steadiest drive to the jerkiest: m/s², m/s², rad/s²."""
_NOISES = 2.0 ** np.arange(3, -8, -0.5)
"""Times the variances of places, which their noise may really have."""
_ENOUGH = 300  # times that tell the noise
_RAREST = 1e-9  # share of a kind of drive, at least: no drive is so long that it rules one out
_NEVER = 1e-6  # share of a density below which it explains nothing
_SETTLED = 0.0003  # share by which no kind of drive explains places better than all: no other shares do
_ROUNDS = 5000  # of expectation maximisation, at most
_SHORTEST = 1e-8  # s that half a sweep takes, where it is taken at once


class Kinds(NamedTuple):
    """Kinds of drives that places may show.

    densities  (D, Z, 3) of the jerk in the stretches of time around a sweep
    first      (N,) of these, which is the first of each kind
    often      (D,) how often each is the one, where its kind is
    """

    densities: Array
    first: Ints
    often: Array


STEADY = Kinds(np.repeat(JERKS[:, None], STRETCHES, axis=1), np.arange(len(JERKS)), np.ones(len(JERKS)))
"""As steady at all times."""


def kinds(lasts: Array) -> Kinds:
    """Steady drives, and those that have a jolt: in any stretch of time, as often as it `lasts` (Z,) s."""
    pairs = list(combinations(JERKS, 2))
    one = np.eye(STRETCHES, dtype=np.bool_)[..., None]
    jolts = np.concatenate([np.where(one, jolted, steady) for steady, jolted in pairs])
    return Kinds(
        np.concatenate([STEADY.densities, jolts]),
        np.append(STEADY.first, len(JERKS) + STRETCHES * np.arange(len(pairs))),
        np.append(STEADY.often, np.tile(lasts / lasts.sum(), len(pairs))),
    )


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
        _lasts(t, h),
    )


def _lasts(t: Array, h: Array) -> Array:
    """Mean lengths (Z,) s of the stretches of time around sweeps of half lengths h (T,), by places at t (T, K) s."""
    beside = np.where(t == 0, np.inf, np.abs(t)).min(axis=1)
    beside = np.where(np.isfinite(beside), np.maximum(beside, h), h)
    ends = np.stack([-t.min(axis=1), t.max(axis=1)])
    before, after = np.where(ends > 0, beside - h, 0.0)
    early, late = np.maximum(ends + h - beside, 0.0)
    return np.stack([early, before, h, h, after, late]).mean(axis=1)


class Drive(NamedTuple):
    """What the places of a whole drive say of it.

    noise      times the variances of the places, which is what explains them best: poses of scans on one map share its
               errors, which are no noise from one to the next; one factor, as the same surfaces tell all dimensions
    densities  (D, Z, 3) of the jerk, those that explain any of the places
    shares     (D, 3) how often each of these explains them best; 0 where it never does
    """

    noise: float
    densities: Array
    shares: Array

    @classmethod
    def of(cls, given: Window) -> "Drive":
        """By some of its times, maximum likelihood of noise and jerk: one of them alone takes the other's place."""
        times = np.arange(0, len(given.told), -(-len(given.told) // _ENOUGH))
        likelihoods = [_most_likely(given, times, noise, STEADY)[0] for noise in _NOISES]
        noise = float(_NOISES[int(np.argmax(likelihoods))])
        among = kinds(given.lasts)
        shares = _most_likely(given, times, noise, among)[1]
        # Of drives that are looked at in part, the rest may be jerkier still: the steady densities stay.
        counts = (shares > _NEVER) | (np.arange(len(shares)) < len(JERKS))[:, None]
        some = counts.any(axis=1)
        return cls(noise, among.densities[some], np.where(counts, shares, 0.0)[some])


def _most_likely(given: Window, some: Ints, noise: float, among: Kinds) -> tuple[float, Array]:
    """Log-likelihood of `noise` times the variances at some of the times, with the shares (D, 3) of densities among
    these that make it largest."""
    found = np.empty((len(among.densities), len(some), 3))
    evidences(given, some, noise, among.densities, found)
    highest = found.max(axis=0)
    likelihoods = np.add.reduceat(among.often[:, None, None] * np.exp(found - highest), among.first)
    likelihoods = np.ascontiguousarray(likelihoods.transpose(2, 0, 1))  # (3, N, S)
    shares = np.full((3, 1, len(among.first)), 1 / len(among.first))
    for _ in range(_ROUNDS):
        mixed = shares @ likelihoods
        gains = (1 / mixed) @ likelihoods.mT / len(some)
        if gains.max() < 1 + _SETTLED:
            break
        shares = np.maximum(shares * gains, _RAREST)
    each = np.diff(np.append(among.first, len(among.densities)))
    shares = np.repeat(shares[:, 0].T, each, axis=0) * among.often[:, None]
    return float(highest.sum() + np.log(mixed).sum()), shares


def estimated(given: Window, drive: Drive) -> tuple[Array, Array, Array]:
    """Speeds and accelerations (T, 2, 3) with covariances (T, 3, 2, 2): each jerk counts as it explains the places.

    The acceleration is the one with which the sweep would begin where it began, seen from its mean place. The third,
    (T, 2, 3), are their covariances with the error of the place at the time itself.
    """
    T = len(given.told)
    rates, shared, spread = np.empty((T, 2, 3)), np.empty((T, 2, 3)), np.empty((T, 3, 2, 2))
    mix(given, drive.noise, drive.densities, drive.shares, rates, spread, shared)
    return rates, spread, shared
