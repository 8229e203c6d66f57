"""What clustering found in one scan, and the moments of its clusters."""

from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.noise import SensorNoise
from lidarcore.scan import Scan

NONE = -1
"""Label of a beam that is in no cluster."""


@dataclass(frozen=True, slots=True, eq=False)
class Clusters:
    """K clusters in the sensor frame, numbered by their first beam counter-clockwise from straight ahead.

    means        (K, 2) m, mean of the members [EKF 6, 11]
    covariances  (K, 2, 2) m², of `means`, as of a landmark's measurement: the noise of the sensor to first order, and
                 where between two beams the object ends. They know nothing of which side is in view: as the
                 sensor goes around a post of radius r, the mean stays about pi r / 4 in front of its centre.
    scatters     (K, 2, 2) m², of the members about their mean, over their number [EKF 12]: the region the object
                 takes up, which the paper draws and uses as its covariance; singular where members lie in a line
    counts       (K,) members
    labels       (N,) cluster of each beam of the scan, -1 for none
    """

    means: Array
    covariances: Array
    scatters: Array
    counts: Ints
    labels: Ints

    def __len__(self) -> int:
        return len(self.counts)

    def __repr__(self) -> str:
        return f"Clusters({len(self)} clusters of {self.counts.sum()} of {len(self.labels)} beams)"


def summarise(scan: Scan, beams: Ints, labels: Ints, noise: SensorNoise) -> Clusters:
    """The clusters that labels (n,), 0 to K - 1 or NONE, make of some beams (n,) in the order of the ring."""
    all_labels = np.full(len(scan), NONE)
    all_labels[beams] = labels
    order = np.argsort(labels, kind="stable")
    order = order[labels[order] != NONE]
    members, of = beams[order], labels[order]
    counts = np.bincount(of)
    starts = np.cumsum(counts) - counts

    def sums(values: Array) -> Array:
        """Sum over the members of each cluster."""
        return np.add.reduceat(values, starts, axis=0) if len(starts) else np.empty((0, *values.shape[1:]))

    n = counts[:, None]
    means = sums(scan.xy[members]) / n
    d = scan.xy[members] - means[of]
    scatters = sums(d[:, :, None] * d[:, None, :]) / n[..., None]
    C = noise.point_covariances(scan.ranges[members], scan.bearings[members])
    ends = d[_ends(scan.bearings[members], starts)]
    covariances = sums(C) / n[..., None] ** 2 + _of_sampling(ends / (n[..., None] - 1))
    return Clusters(means, covariances, scatters, counts, all_labels)


def _ends(bearings: Array, starts: Ints) -> Ints:
    """Indices (K, 2) of the outermost members of each cluster: on either side of the widest gap around the ring.

    bearings (n,) rad are sorted by cluster and around the ring; each cluster begins at one of starts (K,).
    """
    ends = np.empty((len(starts), 2), np.int64)
    for k, of_one in enumerate(np.split(bearings, starts[1:]) if len(starts) else ()):
        last = int(np.argmax(np.diff(of_one, append=of_one[0]) % (2 * np.pi)))
        ends[k] = starts[k] + last, starts[k] + (last + 1) % len(of_one)
    return ends


def _of_sampling(shifts: Array) -> Array:
    """Covariances (K, 2, 2) m² of means because beams meet an object anywhere: shifts (K, 2, 2), two for each.

    Each end of the object is uniformly distributed over one step beyond its outermost point; a whole step would
    shift the mean by what is given. On a flat face with steps s this is s² / 24.
    """
    return np.einsum("kei,kej->kij", shifts, shifts) / 12
