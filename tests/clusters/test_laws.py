"""What every clustering method must obey."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import islice

import numpy as np
import pytest
from post_scenes import NOISE, Posts, around, posts_ahead, rolled, same_partition, scenes, turned
from real_recordings import each, where

from lidarcore import Scan, SensorNoise, open_recording
from lidarcore.clusters import CLUSTERERS, ClusterSettings, cluster
from lidarcore.simulation import SimulatedSensor, furnished_room, random_pose

every_method = pytest.mark.parametrize("method", CLUSTERERS)
ROOM = furnished_room()
RECORDINGS = [
    "rplidar_csv_rooms/nut_room.csv.gz",
    "windsor_rplidar_mat/scans_a.mat",
    "intel_odometry_groundtruth/intel_scans_odom_corrected.csv.gz",
    "rplidar_raw_serial_hex/realterm_capture_1.txt",
]


def settings(method, **changes):
    return ClusterSettings(method=method, **{"noise": NOISE, "min_points": 2} | changes)


def room_scans(count, seed=3):
    rng = np.random.default_rng(seed)
    sensor = SimulatedSensor(ROOM, NOISE, beams=300)
    return [sensor.scan(random_pose(ROOM, rng), rng)[0] for _ in range(count)]


def assert_same(found, expected, turn=0.0):
    """The same clusters, those expected turned counter-clockwise by an angle."""
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    # Sorted by bearing before turning: numbers start straight ahead, so they change as the sensor turns.
    i = np.argsort(np.arctan2(*(found.means @ R).T[::-1]))
    j = np.argsort(np.arctan2(*expected.means.T[::-1]))
    assert found.counts[i] == pytest.approx(expected.counts[j])
    assert found.means[i] == pytest.approx(expected.means[j] @ R.T, abs=1e-9)
    assert found.covariances[i] == pytest.approx(R @ expected.covariances[j] @ R.T, rel=1e-6, abs=1e-12)
    assert found.scatters[i] == pytest.approx(R @ expected.scatters[j] @ R.T, rel=1e-6, abs=1e-12)


def assert_consistent(found, scan, min_points):
    """What is said of each cluster agrees, and every covariance is one."""
    assert found.labels.shape == (len(scan),)
    assert (found.labels[~scan.valid] == -1).all()
    assert (np.bincount(found.labels + 1, minlength=1)[1:] == found.counts).all()
    assert (found.counts >= min_points).all()
    assert np.isfinite(found.means).all()
    assert (np.linalg.eigvalsh(found.covariances) > 0).all()
    assert (np.linalg.eigvalsh(found.scatters) > -1e-9).all()
    assert found.means.shape == (len(found), 2)
    assert found.covariances.shape == found.scatters.shape == (len(found), 2, 2)


@every_method
@pytest.mark.parametrize("number", [1, 2, 3, 5, 8])
def test_posts_a_metre_apart_are_found_without_being_told_their_number(method, number):
    for scan, post in scenes(5, number, seed=number):
        assert same_partition(cluster(scan, settings(method)).labels, post)


@pytest.mark.long
@every_method
def test_the_start_of_the_ring_does_not_matter(method):
    for scan in room_scans(2):
        expected = cluster(scan, settings(method))
        for k in (1, 77, 150, 299):
            found = cluster(rolled(scan, k), settings(method))
            assert (np.roll(found.labels, k) == expected.labels).all()
            assert_same(found, expected)


@every_method
@pytest.mark.parametrize("turn", [0.3, np.pi / 2, -2.5])
def test_clusters_turn_with_the_sensor(method, turn):
    rng = np.random.default_rng(8)
    posts = posts_ahead(6, rng)
    scan, _ = posts.scan(around(), rng)
    assert_same(cluster(turned(scan, turn), settings(method)), cluster(scan, settings(method)), turn)


@every_method
def test_an_object_behind_the_sensor_is_not_cut_by_the_seam(method):
    rng = np.random.default_rng(9)
    scan, post = Posts(np.array([[-2.0, 0.01], [3.0, 0.0], [0.0, 3.0]])).scan(around(), rng)
    assert same_partition(cluster(scan, settings(method)).labels, post)


@pytest.mark.long
@every_method
def test_the_same_scan_gives_the_same_clusters_in_any_thread(method):
    scans = room_scans(2) * 3
    with ThreadPoolExecutor(3) as pool:
        together = list(pool.map(lambda scan: cluster(scan, settings(method)), scans))
    for scan, found in zip(scans, together, strict=True):
        alone = cluster(scan, settings(method))
        assert (found.labels == alone.labels).all()
        assert (found.means == alone.means).all()
        assert (found.covariances == alone.covariances).all()


@every_method
@pytest.mark.parametrize("min_points", [2, 10])
def test_a_furnished_room_gives_consistent_clusters(method, min_points):
    for scan in room_scans(3, seed=4):
        assert_consistent(cluster(scan, settings(method, min_points=min_points)), scan, min_points)


@every_method
def test_clusters_are_numbered_counter_clockwise_from_straight_ahead(method):
    for scan, _ in scenes(3, 5, seed=12):
        labels = cluster(scan, settings(method)).labels
        beams = np.argsort(scan.bearings % (2 * np.pi))
        _, first = np.unique(labels[beams][labels[beams] >= 0], return_index=True)
        assert (np.diff(first) > 0).all()


@every_method
def test_points_out_of_reach_are_as_if_they_were_not_there(method):
    for scan, _ in scenes(3, 8, seed=13):
        near = Scan(np.where(scan.ranges <= 4.0, scan.ranges, np.nan), scan.bearings)
        found = cluster(scan, settings(method, max_range=4.0))
        assert (found.labels == cluster(near, settings(method)).labels).all()
        assert (found.labels[~(scan.ranges <= 4.0)] == -1).all()


@every_method
@pytest.mark.parametrize("beams", [1, 2, 5])
def test_a_scan_with_too_few_returns_has_no_clusters(method, beams):
    blind = Scan(np.full(beams, np.nan), np.linspace(-1, 1, beams))
    lone = Scan([2.0] + [np.nan] * (beams - 1), np.linspace(-1, 1, beams))
    for scan in (blind, lone):
        found = cluster(scan, settings(method))
        assert len(found) == 0
        assert_consistent(found, scan, 2)


@every_method
def test_points_in_one_place_are_one_cluster_with_a_covariance(method):
    scan = Scan(np.full(6, 2.0), np.zeros(6))
    found = cluster(scan, settings(method))
    assert found.counts.tolist() == [6]
    assert_consistent(found, scan, 2)


@every_method
@pytest.mark.parametrize("recording", each(RECORDINGS))
def test_real_scans_give_consistent_clusters(method, recording):
    scan = max(islice(open_recording(where(recording)), 20), key=lambda scan: scan.valid.sum())
    found = cluster(scan, settings(method, noise=SensorNoise()))
    assert len(found) > 0
    assert_consistent(found, scan, 2)
    assert_same(cluster(rolled(scan, len(scan) // 3), settings(method, noise=SensorNoise())), found)


def test_the_first_use_loads_scikit_learn_and_not_the_import():
    code = "import sys, lidarcore.clusters; sys.exit('sklearn' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
