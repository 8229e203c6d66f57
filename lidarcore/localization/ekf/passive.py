"""The part of a map that is out of reach, left alone until it is needed (compressed filter).

While the filter works in its active part A, the mean and covariance of the passive part B follow from three small
arrays [Guivant and Nebot 2001, IEEE Trans. Robotics and Automation 17(3), 242-257]: a matrix Phi with
P_AB = Phi B_0, a matrix Psi with P_BB = P_0 - B_0^T Psi B_0, and a vector theta with x_B = x_0 + B_0^T theta, where
B_0 are rows of P_AB as they once were. Only when the active part changes, a term -W^T W of a low rank is noted here,
and subtracted from a few rows at each scan.
"""

from collections.abc import Callable
from typing import Any, Self, TypeVar

import numpy as np
import scipy.linalg
from threadpoolctl import ThreadpoolController

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.localization.ekf.map_kernels import subtract_products

Function = TypeVar("Function", bound=Callable[..., Any])


def one_thread(function: Function) -> Function:
    """Run on one core: at these sizes two are slower, and far slower if another process uses one of them."""
    limited: Function = _BLAS.wrap(limits=1, user_api="blas")(function)
    return limited


_BLAS = ThreadpoolController()

# The rows settled at each scan: for a rank of 100 all in 25 scans, but not less than is worth the call.
_PACE, _LEAST = 2500, 3_000_000


def roomier(array: Array, *lengths: int) -> Array:
    """The array, or if it is shorter than one of these, a copy with room for half as much again."""
    if np.all(np.greater_equal(array.shape, lengths)):
        return array
    larger = np.zeros(np.where(np.less(array.shape, lengths), np.array(lengths) * 3 // 2, array.shape))
    larger[tuple(slice(have) for have in array.shape)] = array
    return larger


class Gaussian:
    """Mean x and covariance P, of which the first n entries count."""

    def __init__(self, x: Array, P: Array) -> None:
        self.n = len(x)
        self.x, self.P = x, P

    def append(self, x: Array, cross: Array, own: Array) -> int:
        """Append entries x (k,) with covariance (k, k), and cross (k, n) with the others; the first of their rows."""
        n, self.n = self.n, self.n + len(x)
        self.x, self.P = roomier(self.x, self.n), roomier(self.P, self.n, self.n)
        new = slice(n, self.n)
        self.x[new] = x
        self.P[new, :n], self.P[:n, new], self.P[new, new] = cross, cross.T, (own + own.T) / 2
        return n

    def take(self, rows: Ints) -> Self:
        """The marginal of these rows, in their order."""
        return type(self)(self.x[rows], self.P[np.ix_(rows, rows)])


class Passive:
    """Coordinates (n,) of all landmarks, in the order in which they came; those of active ones mean nothing here.

    x     (n,) m, x_0
    base  (c, n) B_0, first those of the motion
    own   (n / 2, 2, 2) m², at least the covariance of each landmark
    """

    def __init__(self) -> None:
        self.x, self.base, self.own = np.empty(0), np.empty((0, 0)), np.empty((0, 2, 2))
        self._P, self._W = np.empty((0, 0)), np.empty((0, 0))
        self._settled = self._settling = 0

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.x)

    @one_thread
    def recall(self, columns: Ints) -> Array:
        """Rows (k, n) of P_0 for coordinates (k,) that become active."""
        rows = self._P[columns, : self.n] - self._W[:, columns].T @ self._W
        self.forget(columns)
        return rows

    def forget(self, columns: Ints) -> None:
        """Take coordinates out of the passive ones."""
        self._W[:, columns] = 0.0

    @one_thread
    def absorb(
        self,
        columns: Ints,
        x: Array,
        P: Array,
        follow: Array,
        Psi: Array,
        theta: Array,
        passive: Bools,
    ) -> None:
        """Take over the mean x (k,) and covariance P (k, k) of active coordinates, and what they did to the others.

        follow (k, c), Psi (c, c) and theta (c,) are those of the active part; passive (n,) is true for the others.
        """
        self._grow(len(passive))
        rows = follow @ self.base
        rows[:, columns] = P
        W = _root(Psi).T @ self.base
        W[:, ~passive] = 0.0
        self._W = np.vstack([self._W, W])
        self.x += theta @ self.base
        self.x[columns] = x
        self._P[columns, : self.n] = rows
        self._P[: self.n, columns] = rows.T
        self._refresh(columns)

    @one_thread
    def rebase(self, motion: Array, cross: Array, columns: Ints, kept: Ints) -> None:
        """New rows B_0: motion (d, c) B_0, but cross (d, k) in columns (k,), and those of kept coordinates."""
        rows = motion @ self.base
        rows[:, columns] = cross
        self.base = np.vstack([rows, self._P[kept, : self.n]])

    def settle(self) -> None:
        """Subtract what was noted from some more rows."""
        if self._settled == 0:
            self._settling = len(self._W)
        if work := self.n * self._settling:
            self._settle(max(work // _PACE, _LEAST // work))

    @one_thread
    def _settle(self, rows: int) -> None:
        first, W = self._settled, self._W[: self._settling]
        last = min(first + max(rows, 1), self.n)
        chunk, rest = slice(first, last), slice(first, self.n)
        self._P[chunk, rest] -= W[:, chunk].T @ W[:, rest]
        self._P[rest, chunk] = self._P[chunk, rest].T
        W[:, chunk] = 0.0
        self._refresh(np.arange(first, last))
        self._settled = last
        if last == self.n:
            self._W, self._settled = self._W[self._settling :], 0

    @one_thread
    def covariances(self, Psi: Array) -> Array:
        """(n / 2, 2, 2) of all landmarks."""
        own = self.own.copy()
        subtract_products(own, self._W, self._W)
        subtract_products(own, self.base, Psi @ self.base)
        return (own + own.transpose(0, 2, 1)) / 2

    def _grow(self, n: int) -> None:
        new = n - self.n
        self.x = np.concatenate([self.x, np.zeros(new)])
        self.own = np.concatenate([self.own, np.zeros((new // 2, 2, 2))])
        self.base, self._W = (np.pad(rows, ((0, 0), (0, new))) for rows in (self.base, self._W))
        self._P = roomier(self._P, n, n)

    def _refresh(self, columns: Ints) -> None:
        even = columns[::2]
        self.own[even // 2] = self._P[even[:, None, None] + [[0], [1]], even[:, None, None] + [0, 1]]


def _root(Psi: Array) -> Array:
    """(c, r) of full rank r with Psi = root root^T."""
    if len(Psi) == 0:
        return Psi
    factor, pivots, rank, _ = scipy.linalg.lapack.dpstrf(Psi, lower=1)
    root = np.empty((len(Psi), rank))
    root[pivots - 1] = np.tril(factor)[:, :rank]
    return root
