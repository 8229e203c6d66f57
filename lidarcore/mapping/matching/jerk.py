"""Speeds and accelerations told by places around a time, where nobody knows how jerkily a sensor is driven.

Accelerations wander: the jerk is white noise, of a density that the places themselves tell
[Rasmussen & Williams, Gaussian Processes, 2006, eq. 2.23 and 5.8].
"""

from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp, softmax

from lidarcore.arrays import Array, Bools

_PRIOR = np.array([[1.0, 10.0, 1.0], [1.0, 10.0, 1.0], [1.0, 10.0, 2.0]])[..., None] ** 2 * np.eye(3)
"""(3, 3, 3) covariances of place, speed and acceleration in m and rad, before any place says anything."""
_JERKS = np.array([0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0])[:, None] * [1.0, 1.0, 2.0]
"""What may change an acceleration within a second, from the steadiest drive to the jerkiest: m/s², m/s², rad/s²."""
_NOISES = 2.0 ** np.arange(3, -8, -0.5)
"""Times the variances of places, which their noise may really have."""
_ENOUGH = 300  # times that tell the noise
_RAREST = 1e-9  # share of a density, at least: no drive is so long that it rules one out
_ROUNDS = 20  # of expectation maximisation


class Window(NamedTuple):
    """K - 1 places around each of T times, one of them at the time itself, and the speed then; each dimension alone.

    basis   (T, 1, K, 3) of place, speed and acceleration at the time
    noise   (T, 3, K, K) covariance of the places
    doubt   (T, 3, K, K) variance of the speed
    wander  (T, 1, K, K) covariance of where white jerk of density 1 has led
    told    (T, 3, K, 1) m, m, rad; the speed, in these per second, is the last one
    own     (T, 1, K) 1 for the place at the time itself, 0 for the others
    """

    basis: Array
    noise: Array
    doubt: Array
    wander: Array
    told: Array
    own: Array

    @classmethod
    def of(cls, told: Bools, t: Array, h: Array, places: Array, variances: Array, speeds: Array) -> "Window":
        """Places (T, K, 3) around t (T, K) s, each the mean over h (T, 1) s before and after; some may not be told.

        speeds (T, 2, 3) are those at the times, with their variances.
        """
        basis = np.stack([np.ones_like(t), t, t**2 / 2 + h**2 / 6], -1) * told[..., None]
        noise = np.where(told[..., None], variances, 1.0)
        given = np.where(told[..., None], places, 0.0)
        wander, own = _wander(np.where(told, t, 0.0)), np.where(t == 0, 1.0, 0.0)
        last = [(0, 0), (0, 1)]
        return cls(
            np.concatenate([basis, np.broadcast_to([[[0.0, 1.0, 0.0]]], (len(t), 1, 3))], 1)[:, None],
            _diagonal(np.pad(noise, [*last, (0, 0)])),
            _diagonal(np.concatenate([np.zeros(noise.shape), speeds[:, 1:]], 1)),
            np.pad(wander, [*last, (0, 1)])[:, None],
            np.swapaxes(np.concatenate([given, speeds[:, :1]], 1), 1, 2)[..., None],
            np.pad(own, last)[:, None],
        )


class Drive(NamedTuple):
    """What the places of a whole drive say of it.

    noise   times the variances of the places, which is what explains them best: poses of scans on one map share its
            errors, which are no noise from one to the next; one factor, as the same surfaces tell all dimensions
    shares  (J, 3) how often each density of the jerk explains them best
    """

    noise: float
    shares: Array

    @classmethod
    def of(cls, window: Window) -> "Drive":
        """By some of its times, maximum likelihood of both together: one of them alone takes the other's place."""
        some = Window(*(column[:: -(-len(window.told) // _ENOUGH)] for column in window))
        likelihoods, shares = zip(*(_most_likely(some, noise) for noise in _NOISES), strict=True)
        best = int(np.argmax(likelihoods))
        return cls(float(_NOISES[best]), shares[best])


def _most_likely(window: Window, noise: float) -> tuple[float, Array]:
    """Log-likelihood of `noise` times the variances, with the shares (J, 3) of densities that make it largest."""
    evidences = np.array([_evidence(window, noise, jerk)[0] for jerk in _JERKS])
    shares = np.full((len(_JERKS), 3), 1 / len(_JERKS))
    for _ in range(_ROUNDS):
        shares = softmax(evidences + np.log(shares)[:, None], axis=0).mean(axis=1)
        shares = np.maximum(shares, _RAREST)
    return float(logsumexp(evidences + np.log(shares)[:, None], axis=0).sum()), shares


def estimated(window: Window, drive: Drive) -> tuple[Array, Array, Array]:
    """Speeds and accelerations (T, 2, 3) with covariances (T, 3, 2, 2): each jerk counts as it explains the places.

    The third, (T, 2, 3), are their covariances with the error of the place at the time itself.
    """
    fits = [_fit(window, drive.noise, jerk) for jerk in _JERKS]
    evidences, rates, covariances, gains = (np.stack(column) for column in zip(*fits, strict=True))
    shares = softmax(evidences + np.log(drive.shares)[:, None], axis=0)[..., None, None]
    mean = (shares * rates).sum(axis=0)
    off = rates - mean
    shared = ((shares * gains).sum(axis=0) @ (drive.noise * window.noise) @ window.own[..., None])[..., 0]
    speeds, with_place = (np.swapaxes(rows, 1, 2).copy() for rows in (mean[..., 0], shared))
    return speeds, (shares * (covariances + off @ off.mT)).sum(axis=0), with_place


def _fit(window: Window, noise: float, jerk: Array) -> tuple[Array, Array, Array, Array]:
    """Log evidence (T, 3) of `noise` times the variances and of a density (3,); speed and acceleration
    (T, 3, 2, 1) with covariance (T, 3, 2, 2), if they are so, and what they take from each place (T, 3, 2, K).
    """
    A = window.basis
    evidence, N, inverse = _evidence(window, noise, jerk)
    gain = (_PRIOR @ A.mT @ inverse)[..., 1:, :]
    left = np.eye(3)[1:] - gain @ A
    return evidence, gain @ window.told, left @ _PRIOR @ left.mT + gain @ N @ gain.mT, gain


def _evidence(window: Window, noise: float, jerk: Array) -> tuple[Array, Array, Array]:
    """As `_fit`: log evidence (T, 3), covariance (T, 3, K, K) of the places if the motion at the time is known, and the
    inverse of what it is if that is not.
    """
    A, y = window.basis, window.told
    N = noise * window.noise + window.doubt + (jerk**2)[:, None, None] * window.wander
    S = A @ _PRIOR @ A.mT + N
    inverse = np.linalg.inv(S).astype(np.float64, copy=False)
    evidence: Array = -0.5 * ((y.mT @ inverse @ y)[..., 0, 0] + np.linalg.slogdet(S)[1])
    return evidence, N, inverse


def _diagonal(variances: Array) -> Array:
    """(T, 3, K, K) of variances (T, K, 3)."""
    found: Array = np.swapaxes(variances, 1, 2)[..., None] * np.eye(variances.shape[1])
    return found


def _wander(t: Array) -> Array:
    """Covariance (T, K, K) of where white jerk of density 1 has led by t (T, K) s, the acceleration at 0 s known."""
    a, b = t[:, :, None], t[:, None, :]
    m = np.where(a * b > 0, np.minimum(np.abs(a), np.abs(b)), 0.0)
    beyond = np.abs(a - b)
    return m**5 / 20 + beyond * m**4 / 8 + beyond**2 * m**3 / 12
