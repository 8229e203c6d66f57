"""Whether a pose that was found, or pairs of points seen and landmarks, may be chance."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import bdtrc

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import act, chi_square_gate, rotation, squared_mahalanobis
from lidarcore.localization.points import Points

_GATE = chi_square_gate(0.999)  # of what is called lying on a landmark
_OWN = 1.0  # m² that each landmark has to itself, so that a single one, or a row of them, is not infinitely dense
_FIXED = 2  # points that a pose is made from lie on landmarks whatever it is


def false_alarms(pose: Array, pairs: Ints, observed: Points, landmarks: Points, tried: int) -> float:
    """How many of so many poses tried would bring as many points onto landmarks, were these scattered evenly.

    A contrario, after Desolneux, Moisan and Morel (2000).
    pose   (3,) T_world_sensor of one of them, which has these pairs (P, 2) of points seen and landmarks
    """
    i, j = pairs.T
    R_world_sensor = rotation(pose[2])
    seen = R_world_sensor @ observed.covariance @ R_world_sensor.T
    apart = act(pose, observed.xy[i]) - landmarks.xy[j]
    on = int((squared_mahalanobis(apart, seen[i] + landmarks.covariance[j]) < _GATE).sum())
    share = float(_covered(seen, observed, landmarks).mean())
    return tried * float(bdtrc(on - _FIXED - 1, len(observed) - _FIXED, share))


def _covered(seen: Array, observed: Points, landmarks: Points) -> Array:
    """Share (K,) of the landmarks' area in which a point with this covariance (K, 2, 2) lies on one of its kind."""
    gates = np.pi * _GATE * np.sqrt(np.linalg.det(seen[:, None] + landmarks.covariance))
    alike = np.asarray(observed.kinds)[:, None] == np.asarray(landmarks.kinds)
    return np.minimum((gates * alike).sum(axis=1) / _area(landmarks.xy), 1.0)


def _area(xy: Array) -> float:
    """m² over which landmarks (L, 2) lie: an even spread over sides a and b has variances a²/12 and b²/12."""
    spread = np.cov(xy.T) if len(xy) > 1 else np.zeros((2, 2))
    return float(12 * np.sqrt(np.linalg.det(spread + _OWN / 12 * np.eye(2))))


def densities(xy: Array, kinds: ArrayLike, of: Ints) -> Array:
    """How many of the landmarks (L, 2), (L,) there are of the kind of each of these (P,), 1/m²."""
    every = np.asarray(kinds)
    some, index = np.unique(every[of], return_inverse=True)
    counts = np.array([np.count_nonzero(every == kind) for kind in some], np.float64)
    per_area: Array = counts[index] / _area(xy)
    return per_area


def evidence(difference: Array, covariance: Array, density: Array) -> float:
    """Log of how many times likelier points are these landmarks than things no map holds, were there as many of those.

    difference, covariance  (P, 2) m and (2 P, 2 P) m² of where they are seen, less where the landmarks are expected
    density                 (P,) 1/m² of landmarks, and so of other things
    """
    d = squared_mahalanobis(difference.ravel(), covariance)
    log_likelihood = -0.5 * (d + np.linalg.slogdet(2 * np.pi * covariance)[1])
    return float(log_likelihood - np.log(density).sum())
