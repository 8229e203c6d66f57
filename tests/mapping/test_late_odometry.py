"""Odometry that is ahead of the scans, or late, as clocks and drivers of real robots leave it: learned on the way."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from mapping_scenes import NOISE, SETTINGS, full_scan

from lidarcore import open_recording
from lidarcore.geometry import PoseTrack, compose, relative
from lidarcore.mapping import Mapper
from lidarcore.mapping.matching.front import FrontEnd
from lidarcore.mapping.matching.odometry_calibration import OdometryCalibration, effects
from lidarcore.mapping.matching.velocity import Velocity
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.rooms import rectangular_room
from lidarcore.simulation.settings import SimulationSettings

USUAL = 0.1  # s, standard deviation from robot to robot


def track_of(scans):
    """Their odometry, at all times between."""
    return PoseTrack(np.array([scan.stamp for scan in scans]), np.array([scan.odometry for scan in scans]))


def shifted(scans, ahead):
    """Scans (N) with their odometry `ahead` s later than they, but for those at both ends."""
    track = track_of(scans)
    return [replace(scan, odometry=track.at(scan.stamp + ahead)) for scan in scans[5:-5]]


def learned(scans):
    """Seconds that odometry turned out to be ahead, and their standard deviation."""
    mapper = Mapper()
    for scan in scans:
        mapper.step(scan)
    calibration = mapper._front._prediction._wheels
    return calibration.errors[3], np.sqrt(calibration._ahead_variance)


def test_effects_are_derivatives_of_the_motion_between_poses_that_are_moved_back():
    motion, before, after = np.random.default_rng(0).normal(size=(3, 3))
    step = 1e-6

    def earlier(seconds):
        return relative(compose(np.zeros(3), -seconds * before), compose(motion, -seconds * after))

    numeric = (earlier(step) - earlier(-step)) / (2 * step)
    np.testing.assert_allclose(effects(motion, before, after)[:, 3], numeric, atol=1e-8)


def test_velocities_are_those_at_the_scans_while_one_speeds_up_evenly():
    velocity, dt, growth = Velocity(), 0.1, np.array([2.0, 0.5, -1.0])
    for k in range(1, 5):
        velocity.step(growth * dt * (k - 0.5))  # in the mean of the step to scan k
        if k > 1:
            np.testing.assert_allclose(velocity.between, growth * dt * (k - 1))
        if k == 2:
            velocity.leave()  # scan 2 is a keyframe
    np.testing.assert_allclose(velocity.began, growth * dt * 2)


@pytest.mark.parametrize("ahead", [-0.15, 0.0, 0.15])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_robot_in_an_office_learns_by_how_much_its_odometry_is_ahead(ahead, seed):
    """What is expected before pulls to zero by the share of its variance that is left."""
    robot = SimulatedRobot(SimulationSettings(world="office", seed=seed))
    found, deviation = learned(shifted(list(islice(robot, 400)), ahead))
    assert deviation < USUAL / 2 + 0.01
    assert abs(found - ahead * (1 - (deviation / USUAL) ** 2)) < 2 * deviation


def test_where_speeds_change_a_motion_is_unsure_by_as_much_as_the_time_is():
    calibration = OdometryCalibration()
    before, after = np.array([0.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.5])
    P = calibration.unknown(np.zeros(3), before, after)
    np.testing.assert_allclose(np.sqrt(np.diag(P)), [USUAL * 1.0, 0.0, USUAL * 0.5])


def test_the_first_start_of_a_robot_may_be_a_tenth_of_a_second_off():
    """It starts with 1 m/s. While it stood, that had made no difference."""
    world, rng, front = rectangular_room(8, 5), np.random.default_rng(0), FrontEnd(SETTINGS.front)
    deviations = []
    for k, x in enumerate([0.0, 0.0, 0.0, 0.0, 0.1]):
        pose = np.array([x, 0.0, 0.0])
        scan = replace(full_scan(world, pose, NOISE, rng), stamp=0.1 * k, odometry=pose)
        deviations.append(np.sqrt(front.step(scan).moved.covariance[0, 0]))
    assert deviations[-2] < 0.03
    assert 0.1 < deviations[-1] < 0.13


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("log", "best"),
    [("turtlebot4_rplidar_rosbag2/macfirst_floor_take_2", 0.175), ("breezyslam_mines_urg/exp2.dat.gz", 0.2)],
)
def test_real_odometry_agrees_with_scans_once_it_is_taken_as_much_earlier_as_was_learned(data, log, best):
    """Turns over 8 scans, by odometry and by a map that was made without it. `best` of steps of 0.025 s is by them."""
    scans = [scan for scan in open_recording(data / log) if scan.odometry is not None]
    mapper = Mapper()
    for scan in scans:
        mapper.step(replace(scan, odometry=None))
    mapper.finish()
    poses = mapper.trajectory()[1]
    track = track_of(scans)

    def off(ahead):
        rolled = np.array([track.at(scan.stamp - ahead) for scan in scans[8:-8]])
        turned, seen = (relative(of[:-8], of[8:])[:, 2] for of in (rolled, poses[8:-8]))
        return np.median(np.abs(turned - seen))

    tried = np.arange(-12, 13) * 0.025
    assert tried[np.argmin([off(ahead) for ahead in tried])] == pytest.approx(best, abs=0.026)
    found, deviation = learned(scans)
    assert abs(found - best) < 0.0125 + 2 * deviation  # half a step, as `best` is one of those tried
    assert off(found) < 0.6 * off(0.0)
