"""The Intel Research Lab from raw odometry and scans, against corrected poses and relations verified by hand."""

import numpy as np
import pytest

from lidarcore import open_recording
from lidarcore.evaluation.maps.accuracy import (
    close_pairs,
    read_relations,
    reference_poses,
    relation_errors,
    relative_errors,
)
from lidarcore.mapping import Mapper

FOLDER = "intel_odometry_groundtruth"


@pytest.mark.long
@pytest.mark.real_data
def test_the_map_of_the_intel_lab_agrees_with_corrected_poses_and_with_relations(data):
    """Odometry drifts by 61.8 m. GMapping's corrected poses have about 2 cm of their own."""
    scans = list(open_recording(data / FOLDER / "intel_scans_odom_corrected.csv.gz"))
    mapper = Mapper()
    placements = [mapper.step(scan) for scan in scans]
    mapper.finish()
    stamps, poses = mapper.trajectory()
    assert len(placements) == 910
    assert all(placement.connected for placement in placements)
    reference, by_odometry = reference_poses(scans)
    assert not by_odometry
    off = relative_errors(poses, reference, close_pairs(reference))
    assert np.hypot(off[:, 0], off[:, 1]).mean() < 0.055
    relations = read_relations(data / FOLDER / "intel.relations.gz")
    errors = relation_errors(relations, stamps, poses)
    assert len(errors) >= 90
    assert errors[:, 0].mean() < 0.03
    assert np.rad2deg(errors[:, 1].mean()) < 1.3
    assert errors[:, 0].max() < 0.2
    odometry = relation_errors(relations, stamps, np.array([scan.odometry for scan in scans]))
    assert odometry[:, 0].mean() > 1
