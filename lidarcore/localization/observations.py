"""What of a scan is taken for landmarks, and when each point was seen.

A filter with a velocity takes the points of a scan in a few moments, one after the other: a correction with the points
of one moment, at the time they were seen, is exact however wrong the velocity is by which the scan was deskewed, and
corrects that velocity with the pose. All at once they would have errors in common.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from lidarcore.arrays import Array, Ints
from lidarcore.clusters import Clusters
from lidarcore.errors import LocalizationError
from lidarcore.features import Features
from lidarcore.geometry import wrap
from lidarcore.localization.ekf.association import Association
from lidarcore.localization.ekf.estimate import Innovation
from lidarcore.localization.points import Points, widths
from lidarcore.localization.settings import NavigationSettings
from lidarcore.scan import Scan


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """Points (K,) in the sensor frame, and the moments (K,) s after the stamp at which they were seen, or None.

    Clusters have no moments: what a moving sensor adds to their means is less than their width.
    """

    points: Points
    times: Array | None

    @classmethod
    def of(
        cls, scan: Scan, features: Features, clusters: Clusters | None, settings: NavigationSettings
    ) -> "Observations":
        """The corners or clusters of a scan, as the settings ask for.

        Raises LocalizationError if that is clusters and there are none.
        """
        if settings.landmarks == "corners":
            points = Points.from_corners(features.corners).scaled(features.noise_excess**2)
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


MOMENTS = 4  # an eighth of a revolution is the most that a point is away from its moment


def corner_times(features: Features, beam_times: Array) -> Array:
    """When each corner (K,) was seen, s after the stamp: where its walls meet, and so the beam that is nearest to it.

    Across the seam of a revolution one of them was seen at its beginning and the other at its end.
    """
    first, second = features.corners.segments.T
    segments, corners = features.segments, features.corners.xy
    beside = np.stack([segments.last_beam[first], segments.first_beam[second]], -1)
    bearing = np.arctan2(corners[:, 1], corners[:, 0])[:, None]
    nearer = np.argmin(np.abs(wrap(features.scan.bearings[beside] - bearing)), axis=1)
    times: Array = beam_times[beside[np.arange(len(beside)), nearer]]
    return times


def nearest_moments(times: Array, beam_times: Array) -> Array:
    """Times (K,), each replaced by the middle of that part of the revolution which it lies in."""
    length = np.ptp(beam_times) / MOMENTS
    middles: Array = length * (np.floor(times / length).clip(0, MOMENTS - 1) + 0.5)
    return middles


def in_moments(times: Array | None, count: int) -> list[tuple[float, Ints]]:
    """Each time that occurs, with the indices of the points seen then; all at 0 if there are no times."""
    if times is None:
        return [(0.0, np.arange(count))]
    return [(float(time), np.flatnonzero(times == time)) for time in np.unique(times)] or in_moments(None, 0)


def joined(parts: Sequence[tuple[Ints, Innovation]]) -> Innovation:
    """Innovations of subsets of the points in one: those of different moments are independent of each other."""
    if len(parts) == 1:
        return parts[0][1]
    associations = [(seen, innovation.association) for seen, innovation in parts]

    def pairs(name: str) -> Ints:
        return np.concatenate([_with_index(getattr(part, name), seen) for seen, part in associations])

    association = Association(
        observed=np.concatenate([seen[part.observed] for seen, part in associations]),
        landmark=np.concatenate([part.landmark for _, part in associations]),
        ambiguous=pairs("ambiguous"),
        incompatible=pairs("incompatible"),
        unmatched=np.concatenate([seen[part.unmatched] for seen, part in associations]),
        new=np.concatenate([seen[part.new] for seen, part in associations]),
        tentative=pairs("tentative"),
    )
    values = np.concatenate([innovation.value for _, innovation in parts])
    return Innovation(association, values, block_diag(*[innovation.covariance for _, innovation in parts]))


def _with_index(pairs: Ints, seen: Ints) -> Ints:
    """Pairs (P, 2) with indices into all points in place of those into the points seen (K,)."""
    return np.stack([seen[pairs[:, 0]], pairs[:, 1]], -1)
