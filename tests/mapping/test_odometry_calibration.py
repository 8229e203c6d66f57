"""What odometry does wrong at every step is learned where walls show it, and holds where they do not."""

from dataclasses import replace

import numpy as np
from chance import SURE
from mapping_scenes import NOISE, SETTINGS, WHEELS, full_scan, sick_scan

from lidarcore.geometry import UncertainPose, compose, relative
from lidarcore.mapping import Mapper
from lidarcore.mapping.matching.odometry_calibration import OdometryCalibration
from lidarcore.simulation import World
from lidarcore.simulation.rooms import rectangular_room

STILL = np.zeros((2, 3))  # velocities where a motion begins and ends
SCALE, BIAS = 1.03, 0.01  # of the wheels, and rad that they turn unnoticed in a metre


def told(motion):
    """What such wheels tell of a motion (3,), but for their noise."""
    return motion * [SCALE, SCALE, 1] + [0, 0, BIAS * np.hypot(*motion[:2])]


def test_errors_are_learned_as_well_as_noise_lets_it():
    rng, wheels = np.random.default_rng(0), OdometryCalibration()
    exact = np.diag([0.001, 0.001, 0.001]) ** 2
    for _ in range(1600):
        true = np.array([rng.uniform(0.3, 1.0), 0.0, rng.normal(0, 0.2)])
        P = WHEELS.covariance(true)
        odometry = told(true) + rng.multivariate_normal(np.zeros(3), P)
        wheels.learn(
            UncertainPose(wheels.corrected(odometry, *STILL), P + exact), UncertainPose(true, exact), *STILL
        )
    ahead = np.array([1.0, 0.0, 0.0])
    # 1600 steps of some 0.65 m: what one metre tells is unsure by the noise of one over the square root of all.
    sigma = np.sqrt(np.diag(WHEELS.covariance(ahead)) / 1040)
    off = wheels.corrected(told(ahead), *STILL) - ahead
    assert abs(off[0]) < SURE * sigma[0] < 0.03
    assert abs(off[2]) < SURE * sigma[2]


def test_a_corridor_that_tells_nothing_teaches_nothing():
    wheels, P = OdometryCalibration(), np.diag([0.1, 0.1, 0.1]) ** 2
    for _ in range(100):
        moved = UncertainPose(np.array([1.0, 0.0, 0.0]), P)
        wheels.learn(moved, moved, *STILL)
    np.testing.assert_array_equal(wheels.corrected(np.array([1.0, 0.2, 0.1]), *STILL), [1.0, 0.2, 0.1])


def test_wheels_that_slip_teach_nothing():
    wheels, P = OdometryCalibration(), np.diag([0.1, 0.1, 0.1]) ** 2
    stuck = UncertainPose(np.zeros(3), np.diag([0.01, 0.01, 0.01]) ** 2)
    wheels.learn(UncertainPose(np.array([1.0, 0.0, 0.0]), P), stuck, *STILL)
    np.testing.assert_array_equal(wheels.corrected(np.array([1.0, 0.0, 0.0]), *STILL), [1.0, 0.0, 0.0])


def corridor():
    """120 m long: pillars along the first 40 m, nothing but even walls after them."""
    walls = [[[-20, -1], [140, -1]], [[140, 1], [-20, 1]]]
    for x in range(-18, 40, 3):
        walls += [[[x, -1], [x, -0.7]], [[x, -0.7], [x + 0.4, -0.7]], [[x + 0.4, -0.7], [x + 0.4, -1]]]
    return World(np.array(walls, float))


def test_a_corridor_without_features_is_as_long_as_wheels_say_that_were_learned_before():
    rng, world, odometry, mapper = np.random.default_rng(1), corridor(), np.zeros(3), Mapper(SETTINGS)
    poses = np.column_stack([np.arange(0, 95, 0.5), np.zeros((190, 2))])
    for k, pose in enumerate(poses):
        if k:
            odometry = compose(odometry, told(relative(poses[k - 1], pose)))
        scan = sick_scan(world, pose, NOISE, rng)
        near = np.where(scan.ranges < 12, scan.ranges, np.nan)
        mapper.step(replace(scan, ranges=near, stamp=float(k), odometry=odometry))
    placed = mapper.trajectory()[1]
    dark = placed[-1, 0] - placed[110, 0]  # from where the last pillar is out of sight
    assert abs(dark - (poses[-1, 0] - poses[110, 0])) < 0.01 * (poses[-1, 0] - poses[110, 0])


def test_what_is_learned_at_the_end_of_a_corridor_holds_for_all_of_it():
    """Of 40 m in which nothing shows wheels made 42. Only at the end scans show how far they went."""
    corridor, rng = rectangular_room(60, 2.4), np.random.default_rng(3)
    x = np.concatenate([np.arange(-20, 28, 0.4), np.arange(28, 22, -0.4), np.arange(22, 28, 0.4)])
    truth = np.stack([x, 0.1 * np.sin(x), 0 * x], -1)
    driven, scans = np.zeros(3), []
    for k, pose in enumerate(truth):
        if k:
            driven = driven + (truth[k] - truth[k - 1]) * [1.05, 1.05, 1]
        scan = full_scan(corridor, pose, NOISE, rng)
        seen = np.where(scan.ranges < 8, scan.ranges, np.nan)
        scans.append(replace(scan, ranges=seen, odometry=driven, stamp=float(k)))
    mapper = Mapper(SETTINGS)
    for scan in scans:
        mapper.step(scan)
    way = x[-1] - x[0]
    assert abs(mapper.trajectory()[1][-1, 0] - way) > 1.2
    for _ in range(2):
        mapper._back.recalibrate(mapper._front.wheels)  # as before loops are looked for once more
        assert abs(mapper.trajectory()[1][-1, 0] - way) < 0.6
