"""Which observation is which landmark: one to one, by optimal assignment within chi-square gates.

The sum of squared Mahalanobis distances is minimal over all one-to-one pairings (Munkres 1957); pairs that are good
one by one and contradict each other are then left out until all are jointly compatible (Neira and Tardós 2001).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment
from scipy.special import chdtri

from lidarcore.localization.points import Points
from lidarcore.localization.settings import LocalizationSettings
from lidarcore.scan import Array, Ints

_FORBIDDEN = 1e9


@dataclass(frozen=True, slots=True, eq=False)
class Association:
    """Indices of observations and landmarks; every observation is in exactly one of the groups.

    observed, landmark  (P,) pairs that are used
    ambiguous           (A, 2) observation and landmark of pairs with a rival almost as likely: not used
    incompatible        (J, 2) of pairs that contradict the others: not used
    unmatched           (U,) observations without a landmark in their gate, some of them
    new                 (N,) far from every landmark of their kind
    """

    observed: Ints
    landmark: Ints
    ambiguous: Ints
    incompatible: Ints
    unmatched: Ints
    new: Ints

    def without(self, pair: int) -> "Association":
        """The same with one pair found incompatible."""
        return Association(
            np.delete(self.observed, pair),
            np.delete(self.landmark, pair),
            self.ambiguous,
            np.vstack([self.incompatible, [self.observed[pair], self.landmark[pair]]]),
            self.unmatched,
            self.new,
        )


def gate_of(probability: float, dimension: int = 2) -> float:
    """Squared Mahalanobis distance that this share of the true pairs stays under."""
    return float(chdtri(dimension, 1 - probability))


def squared_distances(innovations: Array, covariances: Array) -> Array:
    """nu^T S^-1 nu of innovations (..., 2) with covariances (..., 2, 2)."""
    a, b, d = covariances[..., 0, 0], covariances[..., 0, 1], covariances[..., 1, 1]
    x, y = innovations[..., 0], innovations[..., 1]
    distances: Array = (d * x**2 - 2 * b * x * y + a * y**2) / (a * d - b**2)
    return distances


def match(
    observed: Points, z: Array, S: Array, kinds: ArrayLike, settings: LocalizationSettings
) -> Association:
    """Match what was seen with landmarks expected at z (L, 2) m, sensor frame, covariances S (L, 2, 2), kinds (L,)."""
    distances = squared_distances(observed.xy[:, None] - z, S + observed.covariance[:, None])
    distances[np.asarray(observed.kinds)[:, None] != np.asarray(kinds)] = np.inf
    return associate(distances, settings)


def associate(distances: Array, settings: LocalizationSettings) -> Association:
    """Pair observations with landmarks by squared Mahalanobis distances (K, L); inf where kinds differ."""
    gate, far = gate_of(settings.gate), gate_of(settings.new_gate)
    near = np.flatnonzero((distances < gate).any(axis=0))
    costs = np.where(distances[:, near] < gate, distances[:, near], _FORBIDDEN)
    rows, columns, total = _assign(costs, far)
    rivalled = _rivalled(costs, rows, columns, total, far, 2 * float(np.log(settings.ambiguity)))
    pairs = np.stack([rows, near[columns]], -1)
    is_new = distances.min(axis=1, initial=np.inf) > far
    is_new[rows] = False
    unmatched = np.setdiff1d(np.flatnonzero(~is_new), rows)
    none = np.empty((0, 2), np.int64)
    used = pairs[~rivalled]
    return Association(used[:, 0], used[:, 1], pairs[rivalled], none, unmatched, np.flatnonzero(is_new))


def _assign(costs: Array, unmatched: float) -> tuple[Ints, Ints, float]:
    """Optimal pairs (rows, columns) and their total; a row may stay unmatched at a price."""
    K, L = costs.shape
    alone = np.full((K, K), _FORBIDDEN)
    np.fill_diagonal(alone, unmatched)
    table = np.hstack([costs, alone])
    rows, columns = linear_sum_assignment(table)
    paired = columns < L
    return rows[paired], columns[paired], float(table[rows, columns].sum())


def _rivalled(
    costs: Array, rows: Ints, columns: Ints, total: float, unmatched: float, margin: float
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(P,) true for pairs whose best replacement costs less than the margin more."""
    allowed = costs < _FORBIDDEN
    contested = (allowed.sum(axis=1)[rows] > 1) | (allowed.sum(axis=0)[columns] > 1)
    rivalled = np.zeros(len(rows), np.bool_)
    for pair in np.flatnonzero(contested):
        others = costs.copy()
        others[rows[pair], columns[pair]] = _FORBIDDEN
        rivalled[pair] = _assign(others, unmatched)[2] - total < margin
    return rivalled


def worst_pair(innovation: Array, information: Array, probability: float) -> int | None:
    """Index of the pair whose removal helps most, or None if all pairs are jointly compatible.

    innovation (2 P,) stacked, information (2 P, 2 P) the inverse of its covariance S. Without pair i the joint
    squared distance is smaller by y_i^T ((S^-1)_ii)^-1 y_i, with y = S^-1 nu.
    """
    P = len(innovation) // 2
    y = information @ innovation
    if P < 2 or innovation @ y <= gate_of(probability, 2 * P):
        return None
    blocks = information.reshape(P, 2, P, 2)[np.arange(P), :, np.arange(P)]
    return int(np.argmax(squared_distances(y.reshape(P, 2), blocks)))
