"""Uneven walls against the covariance of an Ornstein-Uhlenbeck process, and noise that grows with range."""

from itertools import islice

import numpy as np
import pytest

from lidarcore import SensorNoise
from lidarcore.simulation import SimulatedSensor, World
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.rooms import rectangular_room
from lidarcore.simulation.settings import SimulationSettings

WALL = World(np.array([[[-5.0, 2.0], [5.0, 2.0]]]))
SHORT = World(np.array([[[-0.1, 2.0], [0.5, 2.0]]]))
ORIGIN = np.zeros(3)


def uneven(deviation: float = 0.004, length: float = 0.08) -> SensorNoise:
    return SensorNoise(1e-4, 1e-5, unevenness=deviation, unevenness_length=length)


def offsets(world: World, at: np.ndarray, pose: np.ndarray = ORIGIN) -> np.ndarray:
    """How far (m) beams towards the points at, 2 of the wall end beyond its line."""
    bearings = np.arctan2(2.0 - pose[1], at - pose[0]) - pose[2]
    ranges, hit = world.cast(pose, bearings)
    assert (hit == 0).all()
    return ranges * np.sin(bearings + pose[2]) + pose[1] - 2.0


@pytest.mark.parametrize("length", [0.03, 0.08, 0.2])
def test_the_pattern_has_the_covariance_of_an_ornstein_uhlenbeck_process(length: float) -> None:
    """4,000 walls: a variance is known to 2.2 %, a correlation to 1.6 %; five of these are allowed."""
    at = np.array([0.0, 0.001, 0.03, 0.1, 0.4])
    walls = 4000
    found = np.array([offsets(SHORT.uneven(uneven(0.004, length), seed), at) for seed in range(walls)])
    expected = 0.004**2 * np.exp(-np.abs(at[:, None] - at) / length)
    np.testing.assert_allclose(np.cov(found.T), expected, atol=5 * 0.022 * 0.004**2)
    np.testing.assert_allclose(found.mean(0), 0, atol=5 * 0.004 / np.sqrt(walls))


def test_the_pattern_is_the_walls_own() -> None:
    """The same from every place and in every scan, another on another wall and with another seed."""
    at = np.linspace(-1, 1, 50)
    world = WALL.uneven(uneven(), 1)
    here = offsets(world, at)
    np.testing.assert_allclose(here, offsets(world, at, np.array([0.7, -1.0, 0.4])), atol=1e-12)
    np.testing.assert_array_equal(here, offsets(WALL.uneven(uneven(), 1), at))
    assert np.abs(np.corrcoef(here, offsets(WALL.uneven(uneven(), 2), at))[0, 1]) < 0.95
    other = World(np.concatenate([WALL.walls, WALL.walls + np.array([0.0, 4.0])]))
    np.testing.assert_array_equal(here, offsets(other.uneven(uneven(), 1), at))


def test_what_sticks_out_on_one_side_is_missing_on_the_other() -> None:
    """A panel seen from below and from above."""
    at = np.linspace(-1, 1, 20)
    world = WALL.uneven(uneven(), 3)
    np.testing.assert_allclose(offsets(world, at), offsets(world, at, np.array([0.0, 4.0, 0.0])), atol=1e-12)


def test_without_unevenness_worlds_and_scans_are_as_before() -> None:
    noise = SensorNoise(0.01, 0.001)
    assert WALL.uneven(noise, 5) is WALL
    room = rectangular_room(6, 4)
    straight, _ = SimulatedSensor(room, noise).scan(ORIGIN, np.random.default_rng(0))
    grown = SensorNoise(0.01, 0.001, range_growth=0.003)
    farther, _ = SimulatedSensor(room, grown).scan(ORIGIN, np.random.default_rng(0))
    truth, _ = room.cast(ORIGIN, straight.bearings)
    assert np.abs(farther.ranges - truth).std() > np.abs(straight.ranges - truth).std()


def test_noise_grows_with_the_square_of_the_range() -> None:
    """Of 20,000 beams at each range the standard deviation is known to 0.5 %; five of these are allowed."""
    noise = SensorNoise(0.002, 1e-5, range_growth=0.001)
    for distance in (1.0, 3.0, 8.0):
        circle = World(rectangular_room(2 * distance, 2 * distance).walls)
        sensor, rng = SimulatedSensor(circle, noise, beams=20_000), np.random.default_rng(1)
        scan, _ = sensor.scan(ORIGIN, rng)
        truth, _ = circle.cast(ORIGIN, scan.bearings)
        sigma = np.hypot(0.002, 0.001 * truth**2)
        assert ((scan.ranges - truth) / sigma).std() == pytest.approx(1, abs=0.025)


def test_a_simulated_robot_sees_the_walls_that_its_noise_tells_of() -> None:
    noise = SensorNoise(1e-4, 1e-5, unevenness=0.005, unevenness_length=0.1)
    settings = SimulationSettings(world="furnished room", path="standing", noise=noise, dropouts=0, mixed=0)
    robot = SimulatedRobot(settings)
    off = []
    for scan in islice(robot, 3):
        straight, _ = robot.place.world.cast(scan.truth, scan.bearings)
        off.append(np.median(np.abs(scan.ranges - straight)))
    assert 0.002 < np.mean(off) < 0.008
