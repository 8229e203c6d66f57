"""The joint correction of a Gaussian state by matched point landmarks [EKF 18-21]."""

from dataclasses import dataclass

import numpy as np

from lidarcore.localization.association import Association, worst_pair
from lidarcore.scan import Array, Ints


@dataclass(frozen=True, slots=True, eq=False)
class Innovation:
    """Observed minus predicted position of the pairs of an association.

    value       (P, 2) m, sensor frame
    covariance  (2 P, 2 P) m² of the values in one row, S
    """

    association: Association
    value: Array
    covariance: Array

    @property
    def nis(self) -> float:
        """nu^T S^-1 nu: chi-square distributed with 2 P degrees of freedom if the filter is honest."""
        return float(self.value.ravel() @ np.linalg.solve(self.covariance, self.value.ravel()))

    def compatible(self, probability: float) -> tuple["Innovation", Ints]:
        """Leave out pairs until the others are jointly compatible; also which pairs (P,) were kept."""
        kept, innovation = np.arange(len(self.value)), self
        while (worst := innovation._worst(probability)) is not None:
            kept = np.delete(kept, worst)
            rows = (2 * kept[:, None] + [0, 1]).ravel()
            innovation = Innovation(
                innovation.association.without(worst), self.value[kept], self.covariance[np.ix_(rows, rows)]
            )
        return innovation, kept

    def _worst(self, probability: float) -> int | None:
        information = np.asarray(np.linalg.inv(self.covariance), np.float64)
        return worst_pair(self.value.ravel(), information, probability)


def block_diagonal(blocks: Array) -> Array:
    """Matrices (P, 2, 2) on the diagonal of one (2 P, 2 P)."""
    P = len(blocks)
    matrix = np.zeros((P, 2, P, 2))
    matrix[np.arange(P), :, np.arange(P)] = blocks
    return matrix.reshape(2 * P, 2 * P)


def correction(PHt: Array, innovation: Innovation) -> tuple[Array, Array]:
    """What to add to the mean (n,), and W (n, 2 P) with P - W W^T the new covariance, from P H^T (n, 2 P).

    With S = C C^T and W = P H^T C^-T the covariance stays symmetric whatever the rounding.
    """
    C = np.linalg.cholesky(innovation.covariance)
    W = np.linalg.solve(C, PHt.T).T
    return W @ np.linalg.solve(C, innovation.value.ravel()), W
