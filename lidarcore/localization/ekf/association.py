"""Which observation is which landmark: one to one, by optimal assignment within chi-square gates.

The sum of squared Mahalanobis distances is minimal over all one-to-one pairings (Munkres 1957); pairs that are good
one by one and contradict each other are then left out until all are jointly compatible (Neira and Tardós 2001).
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.geometry import chi_square_gate, squared_mahalanobis
from lidarcore.localization.ekf import sighting_kernels
from lidarcore.localization.points import Points
from lidarcore.localization.settings import LocalizationSettings

_FORBIDDEN = 1e9


@dataclass(frozen=True, slots=True, eq=False)
class Association:
    """Indices of observations and landmarks; every observation is in exactly one of the groups.

    observed, landmark  (P,) pairs that are used
    ambiguous           (A, 2) observation and landmark of pairs with a rival almost as likely, or that may be chance:
                        not used
    incompatible        (J, 2) of pairs that contradict the others: not used
    unmatched           (U,) observations without a landmark in their gate, some of them
    new                 (N,) far from every landmark of their kind
    tentative           (T, 2) of pairs with landmarks that are not trusted yet: counted, not used
    """

    observed: Ints
    landmark: Ints
    ambiguous: Ints
    incompatible: Ints
    unmatched: Ints
    new: Ints
    tentative: Ints = field(default_factory=lambda: np.empty((0, 2), np.int64))

    @classmethod
    def none(cls, observed: int) -> "Association":
        """An association of so many observations with no landmark."""
        nothing, no_pairs = np.empty(0, np.int64), np.empty((0, 2), np.int64)
        return cls(nothing, nothing, no_pairs, no_pairs, np.arange(observed), nothing)

    def trusting(self, trusted: Bools) -> "Association":
        """This association, using only pairs whose landmark is trusted (L,)."""
        used = trusted[self.landmark]
        pairs = np.stack([self.observed, self.landmark], -1)
        return replace(
            self, observed=self.observed[used], landmark=self.landmark[used], tentative=pairs[~used]
        )

    def doubted(self) -> "Association":
        """This association with all of its pairs moved to the ambiguous ones."""
        none, pairs = np.empty(0, np.int64), np.stack([self.observed, self.landmark], -1)
        return replace(self, observed=none, landmark=none, ambiguous=np.vstack([self.ambiguous, pairs]))

    def of(self, landmarks: Ints) -> "Association":
        """This association with indices into the whole map, of which only these landmarks (L,) were looked at."""
        pairs = {
            name: np.stack([part[:, 0], landmarks[part[:, 1]]], -1)
            for name in ("ambiguous", "incompatible", "tentative")
            if len(part := getattr(self, name))
        }
        return replace(self, landmark=landmarks[self.landmark], **pairs)

    def without(self, pair: int) -> "Association":
        """This association with one pair moved to the incompatible ones."""
        contradicting = [self.observed[pair], self.landmark[pair]]
        return replace(
            self,
            observed=np.delete(self.observed, pair),
            landmark=np.delete(self.landmark, pair),
            incompatible=np.vstack([self.incompatible, contradicting]),
        )


def match(
    observed: Points, z: Array, S: Array, kinds: ArrayLike, settings: LocalizationSettings
) -> Association:
    """Match what was seen with landmarks expected at z (L, 2) m, sensor frame, covariances S (L, 2, 2), kinds (L,)."""
    distances = sighting_kernels.all_squared_distances(observed.xy, observed.covariance, z, S)
    distances[np.asarray(observed.kinds)[:, None] != np.asarray(kinds)] = np.inf
    return associate(distances, settings)


def associate(distances: Array, settings: LocalizationSettings) -> Association:
    """Pair observations with landmarks by squared Mahalanobis distances (K, L); inf where kinds differ."""
    gate, far = chi_square_gate(settings.gate), chi_square_gate(settings.new_gate)
    within = distances < gate
    clear = within & (within.sum(axis=1, keepdims=True) == 1) & (within.sum(axis=0) == 1)
    rows, columns = np.nonzero(clear)
    rivalled = np.zeros(len(rows), np.bool_)
    if (contested := within & ~clear).any():
        K, L = np.flatnonzero(contested.any(axis=1)), np.flatnonzero(contested.any(axis=0))
        costs = np.where(within, distances, _FORBIDDEN)[np.ix_(K, L)]
        some_rows, some_columns, total = _assign(costs, far)
        some = _rivalled(costs, some_rows, some_columns, total, far, 2 * float(np.log(settings.ambiguity)))
        rows, columns = np.concatenate([rows, K[some_rows]]), np.concatenate([columns, L[some_columns]])
        rivalled = np.concatenate([rivalled, some])
    is_new = distances.min(axis=1, initial=np.inf) > far
    unpaired = ~is_new
    unpaired[rows] = False
    pairs = np.stack([rows, columns], -1)
    none = np.empty((0, 2), np.int64)
    return Association(
        rows[~rivalled],
        columns[~rivalled],
        pairs[rivalled],
        none,
        np.flatnonzero(unpaired),
        np.flatnonzero(is_new),
    )


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
) -> Bools:
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
    if P < 2 or innovation @ y <= chi_square_gate(probability, 2 * P):
        return None
    blocks = information.reshape(P, 2, P, 2)[np.arange(P), :, np.arange(P)]
    return int(np.argmax(squared_mahalanobis(y.reshape(P, 2), blocks)))
