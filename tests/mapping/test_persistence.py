"""A sensor without odometry between bare walls: nothing tells how far it goes along them, and that is claimed."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from mapping_scenes import NOISE, SETTINGS, full_scan

from lidarcore.geometry import UncertainPose
from lidarcore.mapping import Mapper
from lidarcore.mapping.matching.persistence import Persistence
from lidarcore.simulation.rooms import rectangular_room

CORRIDOR = rectangular_room(120, 2.4)


def driven(speed: float, seconds: float, reach: float, begin: float) -> Iterator[Mapper]:
    """The map of a sensor that sees so far, after each of ten scans a second; it begins there, between ends at 60 m."""
    rng, mapper = np.random.default_rng(4), Mapper(SETTINGS)
    for k in range(int(10 * seconds)):
        scan = full_scan(CORRIDOR, np.array([begin + 0.1 * speed * k, 0.2, 0.0]), NOISE, rng)
        seen = np.where(scan.ranges < reach, scan.ranges, np.nan)
        mapper.step(replace(scan, ranges=seen, stamp=0.1 * k, odometry=None))
        yield mapper


@pytest.mark.parametrize("speed", [0.0, 0.5, 1.0])
def test_however_it_moves_along_bare_walls_it_is_within_what_is_claimed(speed):
    """Had every step erred by itself, 0.7 m would have been claimed after 20 s."""
    for k, mapper in enumerate(driven(speed, 20, reach=6.0, begin=-10.0)):
        pose, covariance = mapper.here
        off = pose - [0.1 * speed * k, 0.0, 0.0]
        assert abs(off[0]) < 3 * np.sqrt(covariance[0, 0]) + 0.01
        assert np.abs(off[1:]).max() < 0.02


def test_where_scans_tell_the_way_nothing_of_that_is_claimed():
    """At 0.5 m/s towards a wall that it sees."""
    *_, mapper = driven(0.5, 8, reach=40.0, begin=50.0)
    assert abs(mapper.here.pose[0] - 3.95) < 0.05
    assert np.sqrt(mapper.here.covariance[0, 0]) < 0.05


@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_a_finished_map_of_bare_walls_knows_the_heading_and_not_the_way(speed):
    *_, mapper = driven(speed, 20, reach=6.0, begin=-10.0)
    mapper.finish()
    off = mapper.trajectory()[1] - np.outer(0.1 * speed * np.arange(200), [1, 0, 0])
    deviations = np.sqrt(np.diagonal(mapper.covariances(), axis1=1, axis2=2))
    assert (np.abs(off[:, 0]) < 3 * deviations[:, 0] + 0.01).all()
    assert deviations[-1, 0] > 1.0
    assert np.abs(off[:, 1:]).max() < 0.02
    assert deviations[:, 2].max() < 0.1


def test_keyframes_between_which_nothing_tells_the_way_keep_the_heading_that_was_seen():
    """At 1 m/s from a wall, which it loses after 3 s, on between bare walls: the drive seems to go on, and may not."""
    *_, mapper = driven(-1.0, 12, reach=6.0, begin=57.0)
    mapper.finish()
    off = mapper.trajectory()[1] + np.outer(0.1 * np.arange(120), [1, 0, 0])
    deviations = np.sqrt(np.diagonal(mapper.covariances(), axis1=1, axis2=2))
    assert len(mapper.keyframes.numbers) > 20
    assert (np.abs(off[:, 0]) < 3 * deviations[:, 0] + 0.01).all()
    assert deviations[-1, 0] > 1.0
    assert deviations[:, 2].max() < 0.1


def test_errors_of_steps_that_nothing_tells_add_up_themselves():
    """Of a step known to 1 cm, made a hundred times more: a metre, and the speed may have changed besides."""
    motion, exact = Persistence(), np.diag([1e-4, 1e-4, 1e-6]) ** 2
    here, step = np.zeros(3), np.array([0.1, 0, 0])
    found = UncertainPose(step, np.diag([0.01, 1e-4, 1e-6]) ** 2)
    motion.find(UncertainPose(here, exact), UncertainPose(step, np.eye(3)), found, np.zeros((3, 3)))
    for k in range(1, 101):
        known = UncertainPose(step * k, exact)
        guess = UncertainPose(step * (k + 1), exact)
        motion.find(known, guess, guess, np.zeros((3, 3)))
    assert np.sqrt(motion.astray[0, 0]) == pytest.approx(1.0, rel=0.02)
    np.testing.assert_allclose(motion.step, step)


def test_scans_that_were_left_blind_may_have_stopped():
    """Who cannot tell whether it goes on at 0.1 m a step is wrong by that much in either case."""
    motion = Persistence()
    motion.begin(np.array([0.1, 0, 0]))
    motion.stop()
    assert np.sqrt(motion.longer[0, 0]) == pytest.approx(0.1)
    assert not motion.step.any()
