"""The Intel Research Lab from raw odometry and scans, against relations between scans verified by hand."""

import numpy as np
import pytest

from lidarcore import open_recording
from lidarcore.poses import compose, inverse
from lidarcore.scanmatching import ScanSlam

FOLDER = "intel_odometry_groundtruth"


@pytest.mark.real_data
def test_the_map_of_the_intel_lab_agrees_with_relations_verified_by_hand(data):
    """Odometry drifts by 61.8 m. The issue asks for 0.15 m and 2 degrees; graph mapping reaches 0.03 m and 1.3."""
    scans = list(open_recording(data / FOLDER / "intel_scans_odom_corrected.csv.gz"))
    slam = ScanSlam()
    placements = [slam.step(scan) for scan in scans]
    assert len(placements) == 910
    assert all(placement.connected for placement in placements)
    errors = relation_errors(data, *slam.trajectory())
    assert len(errors) == 90
    assert errors[:, 0].mean() < 0.03
    assert np.rad2deg(errors[:, 1].mean()) < 1.3
    assert errors[:, 0].max() < 0.2
    by_odometry = relation_errors(data, slam.trajectory()[0], np.array([scan.odometry for scan in scans]))
    assert by_odometry[:, 0].mean() > 1


def relation_errors(data, stamps, poses):
    """Errors (M, 2) m, rad of the relations between two of the scans: t1 t2 dx dy dz roll pitch yaw."""
    errors = []
    for t1, t2, x, y, _, _, _, yaw in np.loadtxt(data / FOLDER / "intel.relations.gz"):
        i, j = (int(np.argmin(np.abs(stamps - t))) for t in (t1, t2))
        if max(abs(stamps[i] - t1), abs(stamps[j] - t2)) < 2e-6:  # digits of the file
            off = compose(inverse(np.array([x, y, yaw])), compose(inverse(poses[i]), poses[j]))
            errors.append([np.hypot(off[0], off[1]), abs(off[2])])
    return np.array(errors)
