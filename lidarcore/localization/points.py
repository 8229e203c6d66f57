"""Points with covariances and kinds: what a scan shows, and what a map holds."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarcore.errors import CovarianceError, LocalizationError
from lidarcore.features import Corners
from lidarcore.scan import Array


@dataclass(frozen=True, eq=False)
class Points:
    """K points: in the sensor frame if observed, in the world frame if they are a map. Arrays are read-only.

    xy          (K, 2) m
    covariance  (K, 2, 2) m²; or one (2, 2) for all
    kinds       (K,) such as "corner", "post"; or one for all. Only points of one kind are ever matched.

    Raises LocalizationError if shapes differ or a number is not finite, CovarianceError if a covariance is not
    symmetric and positive definite.
    """

    xy: Array
    covariance: Array
    kinds: NDArray[np.str_] | Sequence[str] | str = "corner"

    def __post_init__(self) -> None:
        xy = (
            np.array(self.xy, np.float64).reshape(-1, 2)
            if np.size(self.xy) == 0
            else np.array(self.xy, float)
        )
        if xy.ndim != 2 or xy.shape[1] != 2:
            raise LocalizationError(f"xy has shape {xy.shape}: give x and y of each point, shape (K, 2).")
        covariance, kinds = np.array(self.covariance, np.float64), np.array(self.kinds, np.str_)
        if covariance.shape not in ((2, 2), (len(xy), 2, 2)) or kinds.shape not in ((), (len(xy),)):
            raise LocalizationError(
                f"{len(xy)} points have covariances of shape {covariance.shape} and kinds of shape {kinds.shape}: "
                "give one for each point, or one for all."
            )
        if not np.isfinite(xy).all():
            raise LocalizationError("A point is not finite: leave it out.")
        check_covariance(covariance, "A point's covariance")
        columns = {
            "xy": xy,
            "covariance": np.broadcast_to(covariance, (len(xy), 2, 2)).copy(),
            "kinds": np.broadcast_to(kinds, len(xy)).copy(),
        }
        for name, column in columns.items():
            column.flags.writeable = False
            object.__setattr__(self, name, column)

    def __len__(self) -> int:
        return len(self.xy)

    @classmethod
    def from_corners(cls, corners: Corners) -> Self:
        """The corners of a scan with their consistent covariances: the published ones claim too much for a filter."""
        return cls(corners.xy, corners.covariance_consistent, "corner")

    @classmethod
    def joined(cls, parts: Sequence["Points"]) -> Self:
        """All points of the parts in one."""
        return cls(
            np.concatenate([part.xy for part in parts]),
            np.concatenate([part.covariance for part in parts]),
            np.concatenate([np.asarray(part.kinds) for part in parts]),
        )


def check_covariance(matrices: ArrayLike, name: str) -> None:
    """Raise CovarianceError unless the matrices (..., n, n) are finite, symmetric and positive definite."""
    C = np.asarray(matrices, np.float64)
    if not np.isfinite(C).all():
        raise CovarianceError(
            f"{name} is not finite: leave the measurement out, or give its true covariance."
        )
    transposed = np.swapaxes(C, -1, -2)
    if C.size and np.abs(C - transposed).max() > 1e-9 * np.abs(C).max():
        raise CovarianceError(f"{name} is not symmetric: give (C + C^T) / 2.")
    try:
        np.linalg.cholesky(C)
    except np.linalg.LinAlgError as error:
        raise CovarianceError(
            f"{name} is singular or not positive: nothing is known exactly, give the variances it has."
        ) from error
