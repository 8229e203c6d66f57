"""A mean and a covariance in arrays with room for more."""

from typing import Self

import numpy as np

from lidarcore.scan import Array, Ints


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
