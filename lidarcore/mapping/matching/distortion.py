"""What a scan's own noise, and a wrong idea of the sensor's motion within it, do to where it is found to lie."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.mapping.matching.patches import Patches
from lidarcore.mapping.motion.sweep import half_time, is_swept
from lidarcore.scan import Scan

_PRIOR = np.diag([1.0, 1.0, 1.0])  # 1/m², 1/rad²: patches that do not tell a pose shift nothing


def pose_shift(scan: Scan, seen: Patches) -> Array:
    """How far (2, 3, 3), m and rad, a scan is found from where it was: for velocity and for acceleration the matrix
    that makes it out of what was taken out too much. Both are those in the mean time of its beams, as is the place.

    Walls that were seen before the mean time are displaced one way, those seen after it the other. Where both tell
    the same of the pose, that cancels; walls on one side only, or nearer on one side, do not let it.
    """
    shift = np.zeros((2, 3, 3))
    if not is_swept(scan) or not len(seen.means):
        return shift
    h, t = half_time(scan), seen_since(scan, seen)
    A, W, H = _equations(seen)
    for degree, bend in enumerate((t, t**2 / 2 - h**2 / 6)):
        shift[degree] = -np.linalg.solve(H, W.T @ (bend[:, None] * A))
    return shift


def seen_since(scan: Scan, seen: Patches) -> Array:
    """Times (N,) s from the mean time of a scan's beams until each patch was seen; 0 if they are not known."""
    if scan.beam_times is None or not is_swept(scan):
        return np.zeros(len(seen.means))
    order = np.argsort(scan.bearings)
    bearings = np.arctan2(seen.means[:, 1], seen.means[:, 0])
    since: Array = np.interp(bearings, scan.bearings[order], scan.beam_times[order]) - half_time(scan)
    return since


def own_variances(seen: Patches, unevenness: float) -> Array:
    """(3,) m², rad² of a scan's pose on surfaces that are known, by the noise of its patches alone.

    unevenness m is what their variances contain besides: it weighs them, but the next scan finds it where it was.
    """
    _, W, H = _equations(seen)
    noise, inverse = seen.variances - unevenness**2, np.linalg.inv(H)
    variances: Array = np.diagonal(inverse @ (W.T @ (noise[:, None] * W) + _PRIOR) @ inverse)
    return variances


def _equations(seen: Patches) -> tuple[Array, Array, Array]:
    """What each of N patches says of the pose (N, 3), the same by its weight (N, 3), and the information (3, 3)."""
    (x, y), (a, b) = seen.means.T, seen.normals.T
    A = np.stack([a, b, b * x - a * y], -1)
    W = A / seen.variances[:, None]
    return A, W, W.T @ A + _PRIOR
