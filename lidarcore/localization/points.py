"""Points with covariances and kinds: what a scan shows, and what a map holds."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.clusters import Clusters
from lidarcore.errors import LocalizationError
from lidarcore.features import Corners
from lidarcore.geometry import check_covariance, largest_variance


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
        self._set(
            xy, np.broadcast_to(covariance, (len(xy), 2, 2)).copy(), np.broadcast_to(kinds, len(xy)).copy()
        )

    def _set(self, xy: Array, covariance: Array, kinds: NDArray[np.str_]) -> None:
        for name, column in (("xy", xy), ("covariance", covariance), ("kinds", kinds)):
            column.flags.writeable = False
            object.__setattr__(self, name, column)

    def with_new(self, xy: Array, covariance: Array, kinds: NDArray[np.str_] | None = None) -> Self:
        """Points (K', 2) with covariances (K', 2, 2) derived from these: known to be finite and positive definite."""
        points = object.__new__(type(self))
        points._set(xy, covariance, np.asarray(self.kinds) if kinds is None else kinds)
        return points

    def __len__(self) -> int:
        return len(self.xy)

    def subset(self, which: Bools | Ints) -> Self:
        """The points of which (K,) is true, or with these indices."""
        return self.with_new(self.xy[which], self.covariance[which], np.asarray(self.kinds)[which])

    def none(self) -> Self:
        """No points, of the same kind of thing."""
        return self.subset(np.empty(0, np.int64))

    def blurred(self, sigma: float | Array) -> Self:
        """These points with a further independent error of this standard deviation, m, for all or for each (K,)."""
        blur = np.square(sigma)[..., None, None] * np.eye(2)
        return self.with_new(self.xy, self.covariance + blur)

    def scaled(self, factor: float) -> Self:
        """These points with covariances so many times as large."""
        return self.with_new(self.xy, factor * self.covariance)

    @classmethod
    def from_corners(cls, corners: Corners) -> Self:
        """The corners of a scan with their consistent covariances: the published ones claim too much for a filter."""
        return cls(corners.xy, corners.covariance_consistent, "corner")

    @classmethod
    def from_clusters(cls, clusters: Clusters) -> Self:
        """The means of the clusters of a scan, uncertain by the width of each beside the noise.

        The mean is of the side in view: as the sensor goes around an object, the mean wanders about as far as the
        object is wide.
        """
        return cls(clusters.means, clusters.covariances, "cluster").blurred(widths(clusters) / 2)

    @classmethod
    def joined(cls, parts: Sequence["Points"]) -> Self:
        """All points of the parts in one."""
        return cls(
            np.concatenate([part.xy for part in parts]),
            np.concatenate([part.covariance for part in parts]),
            np.concatenate([np.asarray(part.kinds) for part in parts]),
        )


def widths(clusters: Clusters) -> Array:
    """How wide each cluster (K,) is, m: the length of a line whose points scatter as much."""
    scatter = np.maximum(largest_variance(clusters.scatters), 0.0) if len(clusters) else np.empty(0)
    width: Array = np.sqrt(12 * scatter)
    return width
