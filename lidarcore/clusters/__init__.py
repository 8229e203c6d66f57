"""Clusters of points as landmarks [EKF 1-13], by four methods that are listed once, in CLUSTERERS.

[EKF]: R. Urvina Córdova, E. Aguilar Torres and A. Prado Romo, on simultaneous localization and mapping with lidar
point clouds and machine learning methods.
"""

import numpy as np

from lidarcore.arrays import Ints
from lidarcore.clusters.clusters import NONE, Clusters, summarise
from lidarcore.clusters.registry import CLUSTERERS, Clusterer
from lidarcore.clusters.settings import ClusterSettings
from lidarcore.errors import ScanError
from lidarcore.scan import Scan

__all__ = ["CLUSTERERS", "ClusterSettings", "Clusterer", "Clusters", "cluster"]

FARTHEST = 1e6
"""m; squares of coordinates stay far from overflow, and no lidar reaches as far."""


def cluster(scan: Scan, settings: ClusterSettings | None = None) -> Clusters:
    """Clusters of one scan, sensor frame; the same scan gives the same clusters, wherever its ring starts.

    A scan without enough returns has no clusters. The first call of a method other than `heuristic` loads
    scikit-learn, which takes a second or two.
    Raises ScanError if a range is beyond all lidars (1e6 m), unless the settings' max_range leaves it out.
    """
    settings = settings or ClusterSettings()
    beams = _beams_in_reach(scan, settings.max_range)
    labels = np.full(len(beams), NONE)
    if len(beams) >= settings.min_points:
        labels = _in_order(CLUSTERERS[settings.method].label(scan.xy[beams], settings), settings.min_points)
    return summarise(scan, beams, labels, settings.noise)


def _beams_in_reach(scan: Scan, max_range: float | None) -> Ints:
    """Beams that returned from within max_range (m), counter-clockwise from straight ahead."""
    order = np.argsort(scan.bearings % (2 * np.pi), kind="stable")
    beams = order[scan.valid[order]]
    if max_range is not None:
        beams = beams[scan.ranges[beams] <= max_range]
    if len(beams) and scan.ranges[beams].max() > FARTHEST:
        raise ScanError(
            f"A range is {scan.ranges[beams].max():g} m: give metres, or set max_range to leave it out."
        )
    return beams


def _in_order(labels: Ints, min_points: int) -> Ints:
    """Renumber clusters as they come first; NONE for points of those with fewer than min_points."""
    names, first, inverse, counts = np.unique(
        labels, return_index=True, return_inverse=True, return_counts=True
    )
    kept = (names != NONE) & (counts >= min_points)
    numbers = np.full(len(names), NONE)
    numbers[kept] = np.argsort(np.argsort(first[kept]))
    return numbers[inverse]
