"""What is to be found in a map: the points of one scan, or of the last keyframes as they lie to each other."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import LocalizationError
from lidarcore.geometry import act, relative
from lidarcore.mapping.relocation.settings import RelocationSettings
from lidarcore.scan import Scan


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """N points (N, 2) m and where each was seen from (N, 2) m, both in the frame of the pose that is looked for."""

    points: Array
    origins: Array


def query_of(
    scans: Sequence[Scan],
    poses: Array | None = None,
    at: Array | None = None,
    settings: RelocationSettings | None = None,
) -> Query:
    """The query of scans at poses (K, 3) in any common frame; what will be found is the pose at (3,), else the last.

    One scan needs no pose. Points are thinned to a spacing, so that what is near does not count more than walls that
    are far. Raises LocalizationError if there are no scans or not as many poses.
    """
    settings = settings or RelocationSettings()
    poses = np.zeros((1, 3)) if poses is None else np.asarray(poses, np.float64)
    if not len(scans) or poses.shape != (len(scans), 3) or not np.isfinite(poses).all():
        raise LocalizationError(f"{len(scans)} scans and poses of shape {poses.shape}: give a pose for each.")
    at = poses[-1] if at is None else at
    points, origins = [], []
    for scan, pose in zip(scans, poses, strict=True):
        T_at_scan = relative(at, pose)
        points.append(act(T_at_scan, scan.xy[scan.valid & (scan.ranges <= settings.max_range)]))
        origins.append(np.broadcast_to(T_at_scan[:2], points[-1].shape))
    return Query(*_thinned(np.concatenate(points), np.concatenate(origins), settings))


def _thinned(points: Array, origins: Array, settings: RelocationSettings) -> tuple[Array, Array]:
    """One point a square of the spacing, and of these as many as settings allow, in a fixed random order."""
    cells = np.floor(points / settings.spacing).astype(np.int64)
    _, kept = np.unique(cells, axis=0, return_index=True)
    kept = np.random.default_rng(0).permutation(kept)[: settings.most_points]
    return points[kept], origins[kept]
