"""Where a scan was taken, seen from another: correlative search, then point-to-line ICP with its covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.localization.estimate import as_pose
from lidarcore.poses import wrap
from lidarcore.scan import Array, Scan
from lidarcore.scanmatching.correlative import search
from lidarcore.scanmatching.covariance import match_covariance
from lidarcore.scanmatching.pairing import agreement, align
from lidarcore.scanmatching.settings import MatchSettings
from lidarcore.scanmatching.surface import Surface, surface
from lidarcore.scanmatching.uncertain import as_covariance

_WIDEN = 9.0  # the guess takes part with this many times its covariance, lest it is counted twice in a graph
_MARGIN = 0.2  # m by which a point must lie before a surface to contradict it


@dataclass(frozen=True, slots=True, eq=False)
class ScanMatch:
    """How a scan lies on a reference.

    pose        (3,) T_reference_scan: x m, y m, heading rad
    covariance  (3, 3) of the pose; as large as nine times the guess's where the surfaces say nothing
    inliers     share of the scan's points that lie on surfaces of the reference
    conflicts   share of the scan's points that lie where the reference looked through
    """

    pose: Array
    covariance: Array
    inliers: float
    conflicts: float


def match_scans(
    reference: Scan | Surface,
    scan: Scan | Surface,
    guess: ArrayLike,
    covariance: ArrayLike,
    settings: MatchSettings | None = None,
) -> ScanMatch:
    """Lay a scan on a reference.

    guess (3,) is T_reference_scan as far as it is known (odometry), covariance (3, 3) how well: it sets the window of
    the search. Give a `Surface` instead of a scan that is matched more than once.
    [Olson, ICRA 2009] finds the basin, [Censi, ICRA 2008] the pose in it, [Censi, ICRA 2007] its covariance.
    Raises LocalizationError if the guess is no pose, CovarianceError if its covariance is not positive definite.
    A scan that has nothing in common with the reference is no error: it has few inliers.
    """
    settings = settings or MatchSettings()
    x, P = as_pose(guess, "The guess"), as_covariance(covariance, "The covariance of the guess")
    A, B = (surface(s, settings) if isinstance(s, Scan) else s for s in (reference, scan))
    start = search(A.points, B.points, x, np.sqrt(np.diagonal(P)), settings)
    prior = np.linalg.inv(_WIDEN * P).astype(np.float64)
    return _refine(A, B, start, x, prior, settings.reach)


def _refine(A: Surface, B: Surface, start: Array, guess: Array, prior: Array, reach: float) -> ScanMatch:
    """Point-to-line ICP from a start (3,) on."""
    x, rows = start.copy(), np.empty((len(B.bearings), 5))
    pairs = align(A, B, guess, prior, x, reach, rows)
    x[2] = wrap(x[2])
    _, conflicts = agreement(A, B, x, _MARGIN)
    inliers = float((pairs >= 0).mean()) if len(pairs) else 0.0
    return ScanMatch(x, match_covariance(A, B, x, pairs, rows, prior), inliers, conflicts)
