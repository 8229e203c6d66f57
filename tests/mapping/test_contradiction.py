"""A match that contradicts what wheels say: believed if the scan fits far better than by chance, else not."""

from dataclasses import replace

import numpy as np
import pytest
from mapping_scenes import NOISE, SETTINGS, drive, full_scan

from lidarcore import open_recording
from lidarcore.evaluation.maps.accuracy import backwards
from lidarcore.evaluation.maps.study import prepared
from lidarcore.geometry import UncertainPose, compose, pose_difference, relative
from lidarcore.mapping.matching.front import FrontEnd
from lidarcore.mapping.matching.local_map import LocalMap
from lidarcore.mapping.matching.patches import patches
from lidarcore.mapping.matching.registration import Registration
from lidarcore.mapping.settings import MapperSettings
from lidarcore.simulation import World, furnished_room

GUESS = UncertainPose(np.zeros(3), np.diag([0.05, 0.05, 0.02]) ** 2)


@pytest.mark.parametrize(
    ("off", "inliers", "is_chance"),
    [
        ([0.6, 0.1, -1.4], 0.4, True),
        ([0.6, 0.1, -1.4], 0.9, False),
        ([0.06, 0.02, -0.01], 0.35, False),
    ],
    ids=["elsewhere by chance", "wheels slip", "as wheels say"],
)
def test_what_fits_elsewhere_by_chance_is_not_believed(off, inliers, is_chance):
    scan = full_scan(furnished_room(), np.array([3.0, 3, 0]), NOISE, np.random.default_rng(1))
    seen = patches(scan, SETTINGS.front.match)
    local = LocalMap(SETTINGS.front)
    local.add(scan, seen)
    found = Registration(np.array(off), 1e4 * np.eye(3), inliers)
    assert local.is_chance(seen, local.expects(GUESS), found) == is_chance


def steps_of_the_front_end(scans, reference):
    """(T - 1, 3) errors of the steps from scan to scan: m, m, rad."""
    front, keyframes, poses = FrontEnd(MapperSettings().front), [np.zeros(3)], []
    for scan in scans:
        tracked = front.step(scan)
        poses.append(compose(keyframes[tracked.node], tracked.tie.pose) if poses else np.zeros(3))
        if tracked.keyframe and len(poses) > 1:
            keyframes.append(poses[-1])
    found = np.array(poses)
    return pose_difference(relative(found[:-1], found[1:]), relative(reference[:-1], reference[1:]))


def colonnade(period):
    """Walls 2.4 m apart with a niche at every period, on both sides."""
    corners = [[0, 1.2], [period / 2, 1.2], [period / 2, 1.7], [period, 1.7], [period, 1.2]]
    side = np.stack([corners[:-1], corners[1:]], axis=1)
    left = np.concatenate([side + np.array([x, 0]) for x in np.arange(0, 45, period)])
    return World(np.concatenate([left, left * [1, -1]]))


@pytest.mark.parametrize("seed", range(3))
def test_a_robot_that_backs_out_between_walls_that_repeat_is_not_held_where_it_has_seen_them(seed):
    """Most of each scan is new: one period on, all of it would fit what was seen, against what the wheels say."""
    x = np.arange(40, 10, -1.8)
    poses = np.stack([x, 0 * x, 0 * x], -1)
    scans = drive(poses, np.random.default_rng(seed), world=colonnade(2.0))
    near = [
        replace(scan, ranges=np.where(scan.ranges < 2.5, scan.ranges, np.nan), truth=None) for scan in scans
    ]
    steps = steps_of_the_front_end(near, np.array([scan.truth for scan in scans]))
    assert np.mean(np.hypot(*steps[:, :2].T) > 0.5) < 0.1


@pytest.mark.real_data
def test_a_sensor_that_sees_four_metres_of_a_real_building_is_not_turned_round(data):
    """One scan of 440 had matched a quarter of a turn off, 8 standard deviations of what wheels said, by two fifths."""
    log = open_recording(data / "carmen_radish_corrected" / "aces-corrected.log.gz")
    scans, reference = prepared(list(log), "poor", 0)
    assert reference is not None
    steps = steps_of_the_front_end(
        [replace(scan, ranges=np.where(scan.ranges < 4, scan.ranges, np.nan)) for scan in scans], reference
    )
    assert np.hypot(*steps[:, :2].T).max() < 0.5
    assert np.abs(steps[:, 2]).max() < 0.2


@pytest.mark.real_data
@pytest.mark.parametrize("log", ["aces", "intel"])
def test_a_robot_that_backs_out_of_what_it_has_seen_is_not_held_there(data, log):
    """A real log read backwards: the sensor sees ahead while the robot drives where it has seen nothing.

    Four fifths of a scan fit a metre off, where the corridor had been seen: that had been believed of 30 scans of 439
    in one building, of 7 of 909 in the other.
    """
    scans = list(open_recording(data / "carmen_radish_corrected" / f"{log}-corrected.log.gz"))
    steps = steps_of_the_front_end(*prepared(backwards(scans), "poor", 0))
    assert np.hypot(*steps[:, :2].T).max() < 0.5
