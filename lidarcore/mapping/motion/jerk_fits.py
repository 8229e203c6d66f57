"""Speed and acceleration by places around a time: for each of several densities of the jerk, and by all together."""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import inlined, kernel

_PRIOR = np.array([[1.0, 10.0, 1.0], [1.0, 10.0, 1.0], [1.0, 10.0, 2.0]]) ** 2
"""(3, 3) variances of place, speed and acceleration in m and rad, before any place says anything."""
_Y, _A, _BENT, _OWN = 0, 1, 4, 5  # columns of what is whitened
_EVIDENCE, _RATES, _SPREAD, _SHARED, _FOUND = 0, 1, 3, 6, 8  # what a fit finds


class Window(NamedTuple):
    """K - 1 places around each of T times, one of them at the time itself, and the speed then; each dimension alone.

    basis   (T, K, 3) of place, speed and acceleration at the time
    noise   (T, 3, K) variances of the places
    doubt   (T, 3, K) variance of the speed
    wander  (T, Z, K + 1, K + 1) covariance of what white jerk of density 1 in each of Z stretches of time adds to them
            and, last, to how the sweep is bent
    told    (T, 3, K) m, m, rad; the speed, in these per second, is the last one
    own     (T,) which place is the one at the time itself
    lasts   (Z,) s, how long each stretch of time lasts, on average
    """

    basis: Array
    noise: Array
    doubt: Array
    wander: Array
    told: Array
    own: Ints
    lasts: Array


class _Scratch(NamedTuple):
    """Of one fit after another, of K numbers that are told.

    S     (K, K) their covariance, then its Cholesky factor
    X, G  (K, 6) what is told, the basis, what shares noise with the bend and with the place itself, all whitened; X^T X
    M     (3, 3) information of place, speed and acceleration, then its Cholesky factor
    Z, H  (3, 4) what follows for these, whitened; Z^T Z
    """

    S: Array
    X: Array
    G: Array
    M: Array
    Z: Array
    H: Array


@inlined
def _scratch(K: int) -> _Scratch:
    return _Scratch(
        np.empty((K, K)),
        np.empty((K, 6)),
        np.empty((6, 6)),
        np.empty((3, 3)),
        np.empty((3, 4)),
        np.empty((4, 4)),
    )


@kernel
def evidences(window: Window, some: Ints, noise: float, jerks: Array, found: Array) -> None:
    """Writes log evidences (D, S, 3) of `noise` times the variances and of densities (D, Z, 3) at some (S,) times."""
    K = window.told.shape[2]
    scratch, one = _scratch(K), np.empty(_FOUND)
    for n in range(len(jerks)):
        for s in range(len(some)):
            for d in range(3):
                _fit(window, some[s], d, noise, jerks[n, :, d], scratch, one)
                found[n, s, d] = one[_EVIDENCE]


@kernel
def mix(
    window: Window, noise: float, jerks: Array, shares: Array, rates: Array, spread: Array, shared: Array
) -> None:
    """Writes speeds and accelerations (T, 2, 3) with covariances (T, 3, 2, 2), and theirs (T, 2, 3) with the error of
    the place at the time itself: each of the densities (D, Z, 3) counts as it explains the places.

    shares (D, 3) tell how often each is the one; what is 0 is not looked at.
    """
    K, D = window.told.shape[2], len(jerks)
    scratch, found = _scratch(K), np.empty((D, _FOUND))
    for k in range(len(window.told)):
        for d in range(3):
            best = -np.inf
            for n in range(D):
                found[n], found[n, _EVIDENCE] = 0.0, -np.inf
                if shares[n, d] > 0:
                    _fit(window, k, d, noise, jerks[n, :, d], scratch, found[n])
                    found[n, _EVIDENCE] += np.log(shares[n, d])
                best = max(best, found[n, _EVIDENCE])
            weights = np.exp(found[:, _EVIDENCE] - best)
            weights /= weights.sum()
            mean = weights @ found
            rates[k, :, d], shared[k, :, d] = mean[_RATES:_SPREAD], mean[_SHARED:_FOUND]
            off = found[:, _RATES:_SPREAD] - mean[_RATES:_SPREAD]
            between = off.T @ (weights.reshape(-1, 1) * off)
            spread[k, d, 0, 0] = mean[_SPREAD] + between[0, 0]
            spread[k, d, 0, 1] = spread[k, d, 1, 0] = mean[_SPREAD + 1] + between[0, 1]
            spread[k, d, 1, 1] = mean[_SPREAD + 2] + between[1, 1]


@kernel
def _fit(window: Window, k: int, d: int, noise: float, jerks: Array, scratch: _Scratch, found: Array) -> None:
    """Log evidence, speed and acceleration with three numbers of their covariance, and their covariances with the error
    of the place at the time, of one dimension at one time if the jerk has these densities (Z,).

    Places are y = A x + e, where e, by noise and jerk, shares b with how the sweep is bent: E[bent | e] = b^T N^-1 e.
    """
    S, X, G, M, Z, H = scratch
    K, own = len(S), 0.0
    S[:], X[:, _BENT] = 0.0, 0.0
    for z in range(len(jerks)):
        density, added = jerks[z] ** 2, window.wander[k, z]
        own += density * added[K, K]
        for i in range(K):
            X[i, _BENT] += density * added[i, K]
            for j in range(i + 1):
                S[i, j] += density * added[i, j]
    for i in range(K):
        S[i, i] += noise * window.noise[k, d, i] + window.doubt[k, d, i]
        X[i, _Y], X[i, _OWN] = window.told[k, d, i], 0.0
        for j in range(3):
            X[i, _A + j] = window.basis[k, i, j]
    X[window.own[k], _OWN] = noise * window.noise[k, d, window.own[k]]
    logs = _whiten(S, X)
    _products(X, G)
    for j in range(3):
        for i in range(3):
            M[i, j] = G[_A + i, _A + j]
        M[j, j] += 1 / _PRIOR[d, j]
        Z[j, 0], Z[j, 3] = G[_A + j, _Y], G[_A + j, _OWN]
        Z[j, 1], Z[j, 2] = (1.0 if j == 1 else 0.0), (1.0 if j == 2 else 0.0) - G[_A + j, _BENT]
    logs += _whiten(M, Z)
    _products(Z, H)
    found[_EVIDENCE] = -0.5 * (G[_Y, _Y] - H[0, 0]) - logs
    found[_RATES], found[_RATES + 1] = H[1, 0], H[2, 0] + G[_BENT, _Y]
    found[_SPREAD], found[_SPREAD + 1] = H[1, 1], H[1, 2]
    found[_SPREAD + 2] = H[2, 2] + own - G[_BENT, _BENT]
    found[_SHARED], found[_SHARED + 1] = H[1, 3], H[2, 3] + G[_BENT, _OWN]


@inlined
def _products(X: Array, G: Array) -> None:
    """Writes X^T X (m, m) of few rows X (n, m): a call of BLAS takes longer."""
    for i in range(X.shape[1]):
        for j in range(i + 1):
            total = 0.0
            for k in range(len(X)):
                total += X[k, i] * X[k, j]
            G[i, j] = G[j, i] = total


@kernel
def _whiten(S: Array, X: Array) -> float:
    """Divides X (n, m) by the Cholesky factor L of S (n, n) = L L^T, from the left; returns the logarithm of det L.

    Only the lower triangle of S counts, and becomes L.
    """
    n, det = len(S), 1.0
    for j in range(n):
        for i in range(j, n):
            for q in range(j):
                S[i, j] -= S[i, q] * S[j, q]
        root = np.sqrt(S[j, j])
        det *= root
        for i in range(j, n):
            S[i, j] /= root
        for q in range(j):
            for c in range(X.shape[1]):
                X[j, c] -= S[j, q] * X[q, c]
        for c in range(X.shape[1]):
            X[j, c] /= root
    return np.log(det)
