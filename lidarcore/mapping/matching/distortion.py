"""What a wrong idea of the sensor's motion within a scan does to where the scan is found to lie."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.mapping.matching.patches import Patches
from lidarcore.mapping.matching.sweep import is_swept
from lidarcore.scan import Scan

_PRIOR = np.diag([1.0, 1.0, 1.0])  # 1/m², 1/rad²: patches that do not tell a pose shift nothing


def half_time(scan: Scan) -> float:
    """Mean time (s) of a scan's beams after its stamp; 0 if it is not known."""
    return float(np.mean(scan.beam_times)) if scan.beam_times is not None and is_swept(scan) else 0.0


def pose_shift(scan: Scan, seen: Patches) -> Array:
    """How far (2, 3, 3), m and rad, a scan is found from where it was: for velocity and for acceleration the matrix
    that makes it out of what was taken out too much. Both are those in the mean time of its beams, as is the place.

    Walls that were seen before the mean time are displaced one way, those seen after it the other. Where both tell
    the same of the pose, that cancels; walls on one side only, or nearer on one side, do not let it.
    """
    shift = np.zeros((2, 3, 3))
    if scan.beam_times is None or not is_swept(scan) or not len(seen.means):
        return shift
    order = np.argsort(scan.bearings)
    (x, y), (a, b) = seen.means.T, seen.normals.T
    h = half_time(scan)
    t = np.interp(np.arctan2(y, x), scan.bearings[order], scan.beam_times[order]) - h
    A = np.stack([a, b, b * x - a * y], -1)
    W = A / seen.variances[:, None]
    H = W.T @ A + _PRIOR
    for degree, bend in enumerate((t, t**2 / 2 - h**2 / 6)):
        shift[degree] = -np.linalg.solve(H, W.T @ (bend[:, None] * A))
    return shift
