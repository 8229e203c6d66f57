"""The innovation of matched point landmarks [EKF 18-21]."""

from dataclasses import dataclass

import numpy as np

from lidarcore.localization.association import Association, gate_of, worst_pair
from lidarcore.localization.kernels import squared_distance
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
        return float(squared_distance(self.value.ravel(), self.covariance))

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
        if self.nis <= gate_of(probability, 2 * len(self.value)):  # almost always: spares the inverse
            return None
        information = np.asarray(np.linalg.inv(self.covariance), np.float64)
        return worst_pair(self.value.ravel(), information, probability)
