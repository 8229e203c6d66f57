"""What one scan shows is seen at different times: a filter with a velocity takes it in a few moments, one by one.

A correction with the points of one moment at the time they were seen is exact however wrong the velocity is by which
the scan was deskewed, and that velocity is corrected with the pose. All at once they would have errors in common.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from lidarcore.features import Features
from lidarcore.localization.association import Association
from lidarcore.localization.kalman import Innovation
from lidarcore.scan import Array, Ints

MOMENTS = 4  # an eighth of a revolution is the most that a point is away from its moment


def corner_times(features: Features, beam_times: Array) -> Array:
    """When each corner (K,) was seen, s after the stamp."""
    first, second = features.corners.segments.T
    segments = features.segments
    times: Array = (beam_times[segments.last_beam[first]] + beam_times[segments.first_beam[second]]) / 2
    return times


def nearest_moments(times: Array, beam_times: Array) -> Array:
    """Each time (K,) replaced by the middle of that part of the revolution which it lies in."""
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
