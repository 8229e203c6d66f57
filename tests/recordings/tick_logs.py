"""Logs with the counts of encoders, as tests write them, and the way that they tell."""

from pathlib import Path

import numpy as np

from lidarcore import Scan, open_recording
from lidarcore.geometry import compose, inverse, relative
from lidarcore.scan import Array


def scans_of(path: Path, *rows: str) -> list[Scan]:
    path.write_text("".join(rows))
    return list(open_recording(path))


def way(scans: list[Scan], ahead: float) -> Array:
    """(3,) of the turning centre, that many m behind the lidar, from the first scan to the last."""
    poses = [scan.odometry for scan in (scans[0], scans[-1])]
    assert all(pose is not None for pose in poses)
    return relative(*compose(np.array(poses), inverse(np.array([ahead, 0.0, 0.0]))))
