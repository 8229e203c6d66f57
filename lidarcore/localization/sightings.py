"""What of a scan is taken for landmarks, and when it was seen."""

from dataclasses import dataclass

import numpy as np

from lidarcore.clusters import Clusters
from lidarcore.errors import LocalizationError
from lidarcore.features import Features
from lidarcore.localization.moments import corner_times, nearest_moments
from lidarcore.localization.points import Points, widths
from lidarcore.localization.settings import NavigationSettings
from lidarcore.scan import Array, Scan


@dataclass(frozen=True, slots=True, eq=False)
class Sightings:
    """Points (K,) in the sensor frame, and the moments (K,) s after the stamp at which they were seen, or None.

    Clusters have no moments: what a moving sensor adds to their means is less than their width.
    """

    points: Points
    times: Array | None

    @classmethod
    def of(
        cls, scan: Scan, features: Features, clusters: Clusters | None, settings: NavigationSettings
    ) -> "Sightings":
        """The corners or clusters of a scan, as the settings ask for.

        Raises LocalizationError if that is clusters and there are none.
        """
        if settings.landmarks == "corners":
            points = Points.from_corners(features.corners).scaled(_noise_ratio(features))
            points = points.blurred(settings.filter.unevenness)
            return cls(points, _moments(features, scan.beam_times))
        if clusters is None:
            raise LocalizationError(
                "Clusters are the landmarks, and there are none: find them in the scan first."
            )
        narrow = widths(clusters) <= settings.max_width
        return cls(Points.from_clusters(clusters).subset(narrow), None)


def _moments(features: Features, beam_times: Array | None) -> Array | None:
    if beam_times is None or not (np.isfinite(beam_times).all() and np.ptp(beam_times) > 0):
        return None
    return nearest_moments(corner_times(features, beam_times), beam_times)


def _noise_ratio(features: Features) -> float:
    """How many times larger than told the variance of the ranges seems to be; 1 if it is smaller."""
    return float(np.fmax(1.0, (features.noise_seen / features.settings.noise.sigma_range) ** 2))
