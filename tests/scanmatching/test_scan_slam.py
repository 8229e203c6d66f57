"""SLAM by scan matching around a simulated building, with odometry whose noise is known."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matching_scenes import full_scan, sick_scan, squared
from scipy.stats import chi2

from lidarcore import Scan, SensorNoise
from lidarcore.errors import MotionError
from lidarcore.poses import compose, inverse, wrap
from lidarcore.scanmatching import MatchSettings, ScanSlam, ScanSlamSettings
from lidarcore.simulation import World

NOISE = SensorNoise(0.015, 0.003)
SETTINGS = ScanSlamSettings(match=MatchSettings(noise=NOISE))
# A corridor around a block, with a niche here and a pillar there.
BUILDING = World(
    np.array(
        [
            [[0, 0], [14, 0]], [[14, 0], [14, 4]], [[14, 4], [15, 4]], [[15, 4], [15, 6]], [[15, 6], [14, 6]],
            [[14, 6], [14, 10]], [[14, 10], [5, 10]], [[5, 10], [5, 10.6]], [[5, 10.6], [3, 10.6]],
            [[3, 10.6], [3, 10]], [[3, 10], [0, 10]], [[0, 10], [0, 0]],
            [[2.5, 2.5], [11.5, 2.5]], [[11.5, 2.5], [11.5, 7]], [[11.5, 7], [7, 7.5]], [[7, 7.5], [2.5, 7.5]],
            [[2.5, 7.5], [2.5, 2.5]],
            [[6, 0], [6, 0.4]], [[6, 0.4], [6.5, 0.4]], [[6.5, 0.4], [6.5, 0]],
            [[0, 6.5], [0.3, 6.5]], [[0.3, 6.5], [0.3, 7]], [[0.3, 7], [0, 7]],
        ],
        float,
    )
)  # fmt: skip


def way(step: float, rounds: float) -> np.ndarray:
    """Poses (T, 3) along the middle of the corridor, every `step` m."""
    corners = np.array([[1.25, 1.25], [12.75, 1.25], [12.75, 8.75], [1.25, 8.75], [1.25, 1.25]])
    lengths = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    along = np.arange(0, rounds * lengths[-1], step)
    x, y = (np.interp(along % lengths[-1], lengths, column) for column in corners.T)
    window = np.hanning(2 * int(1.2 / step) + 3)[1:-1]
    smooth = [
        np.convolve(np.pad(v, len(window) // 2, mode="edge"), window / window.sum(), "valid") for v in (x, y)
    ]
    headings = np.unwrap(np.arctan2(np.gradient(smooth[1]), np.gradient(smooth[0])))
    return np.stack([*smooth, headings], -1)


def drive(poses, rng, scanned=sick_scan, odometry=True) -> list[Scan]:
    """Scans at the poses, one a second, with odometry whose errors are as SETTINGS say."""
    driven, scans = poses[0], []
    for k, pose in enumerate(poses):
        if k:
            u = compose(inverse(poses[k - 1]), pose)
            driven = compose(
                driven,
                u + rng.multivariate_normal(np.zeros(3), SETTINGS.odometry.covariance(u), method="cholesky"),
            )
        scan = scanned(BUILDING, pose, NOISE, rng)
        scans.append(replace(scan, stamp=float(k), odometry=driven if odometry else None))
    return scans


def errors(found, poses):
    """(T, 3) of a trajectory that begins at the first true pose's frame."""
    true = np.array([compose(inverse(poses[0]), pose) for pose in poses])
    off = found - true
    off[:, 2] = wrap(off[:, 2])
    return off


def test_a_loop_around_a_building_closes_and_the_covariance_is_honest():
    """What odometry drifts is gone, and the covariance is not smaller than the errors of all runs allow."""
    poses, nees, worst = way(0.5, 1.3), [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        scans = drive(poses, rng)
        slam = ScanSlam(SETTINGS)
        placements = [slam.step(scan) for scan in scans]
        assert all(placement.connected for placement in placements)
        assert sum(placement.loops for placement in placements) > 10
        off = errors(slam.trajectory()[1], poses)
        worst.append(np.hypot(off[:, 0], off[:, 1]).max())
        nees.append([squared(off[k], slam.graph.covariance(placements[k].node)) for k in (30, 60, -1)])
    odometry = errors(np.array([compose(inverse(poses[0]), scan.odometry) for scan in scans]), poses)
    assert np.hypot(*odometry[-1, :2]) > 0.5
    assert max(worst) < 0.2
    # Successive matches share a scan whose errors cancel, which the graph does not know: it is rather too careful.
    assert np.mean(nees, axis=0).max() < chi2.ppf(0.975, 3 * 8) / 8
    assert np.mean(nees) > 0.1


def test_without_odometry_the_motion_is_taken_to_go_on():
    poses = way(0.1, 0.5)
    slam = ScanSlam(SETTINGS)
    for scan in drive(poses, np.random.default_rng(3), full_scan, odometry=False):
        assert slam.step(scan).connected
    assert np.abs(errors(slam.trajectory()[1], poses)[:, :2]).max() < 0.1
    assert len(slam.graph) < len(poses) / 2


def test_scans_between_keyframes_add_no_nodes():
    scan = drive(way(0.5, 0.1), np.random.default_rng(4))[0]
    slam = ScanSlam(SETTINGS)
    placements = [slam.step(replace(scan, stamp=float(k))) for k in range(20)]
    assert len(slam.graph) == 1
    assert np.abs(placements[-1].pose).max() < 0.01


def test_a_blind_scan_hangs_on_odometry_and_the_next_one_finds_back():
    poses = way(0.5, 0.4)
    scans = drive(poses, np.random.default_rng(5))
    scans[12] = replace(scans[12], ranges=np.full(180, np.nan))
    slam = ScanSlam(SETTINGS)
    placements = [slam.step(scan) for scan in scans]
    assert [k for k, placement in enumerate(placements) if not placement.connected] == [12]
    off = errors(slam.trajectory()[1], poses)
    assert np.hypot(off[-1, 0], off[-1, 1]) < 0.1


def test_bad_motion_is_told_and_leaves_everything_as_it_was():
    scans = drive(way(0.5, 0.1), np.random.default_rng(6))
    slam = ScanSlam(SETTINGS)
    for scan in scans[:4]:
        slam.step(scan)
    stamps, poses = slam.trajectory()
    with pytest.raises(MotionError, match="clock went back"):
        slam.step(replace(scans[4], stamp=1.0))
    with pytest.raises(MotionError, match="jumped"):
        slam.step(replace(scans[4], odometry=scans[4].odometry + np.array([100.0, 0, 0])))
    np.testing.assert_array_equal(slam.trajectory()[1], poses)
    slam.step(scans[4])
    assert len(slam.trajectory()[0]) == len(stamps) + 1


def test_the_trajectory_has_every_scan_with_its_stamp():
    scans = drive(way(0.5, 0.2), np.random.default_rng(7))
    slam = ScanSlam(SETTINGS)
    stamps, poses = slam.trajectory()
    assert stamps.shape == (0,)
    assert poses.shape == (0, 3)
    for scan in scans:
        placement = slam.step(scan)
    stamps, poses = slam.trajectory()
    assert all(b > a for a, b in pairwise(stamps))
    np.testing.assert_allclose(poses[-1], placement.pose)
    assert np.linalg.eigvalsh(placement.covariance).min() > 0
