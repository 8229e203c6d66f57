"""What several methods say of corners or walls that were seen: where they are, and with which covariances."""

from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array, Columns, Ints
from lidarcore.evaluation.consistency.design import KINDS

OBSERVATION = 10
"""Numbers of an observation: x, y of a corner or alpha, r of a wall; published (4), consistent (4)."""


@dataclass(frozen=True, slots=True, eq=False)
class Observations(Columns):
    """R observations of features, all corners or all walls; for `scatter.scatter` sorted by feature and then by scan.

    ids, scans (R,); table (R, M, OBSERVATION) for M methods, NaN where a method did not find the feature; (R, 2) of
    one method.
    """

    ids: Ints
    scans: Ints
    table: Array

    @property
    def starts(self) -> Ints:
        """(K,) where each feature begins."""
        return np.flatnonzero(np.diff(self.ids, prepend=-1))


def covariances(table: Array) -> Array:
    """(..., 2, 4) claimed of observations (..., OBSERVATION), by KINDS."""
    return table[..., 2:].reshape(*table.shape[:-1], len(KINDS), 4)


def root_det(c: Array) -> Array:
    """Root of the determinant (...) of covariances (..., 4), 0 where that is negative."""
    return np.sqrt(np.maximum(c[..., 0] * c[..., 3] - c[..., 1] * c[..., 2], 0.0))
