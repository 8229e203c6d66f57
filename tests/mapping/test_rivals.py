"""A scan that fits two places well: what tells them apart is the guess, or what stands in one of them only."""

from dataclasses import replace

import numpy as np
from mapping_scenes import NOISE, SETTINGS, full_scan

from lidarcore.geometry import UncertainPose, pose_difference, squared_mahalanobis
from lidarcore.mapping.matching.expectation import expectation
from lidarcore.mapping.matching.front import FrontEnd
from lidarcore.mapping.matching.registration import Registration
from lidarcore.mapping.tracked import Tracked
from lidarcore.simulation import World
from lidarcore.simulation.rooms import box, rectangular_room

HALL = rectangular_room(20, 4)  # looks the same after half a turn around its middle
WITH_A_POST = World(np.concatenate([HALL.walls, box(1.5, 1.0, 0.15, 0.15, 0.0)]))
BEGIN, END = np.array([0.1, 0.05, 0.0]), np.array([0.7, 0.05, 0.0])
MIRRORED = np.array([-0.8, -0.1, np.pi])  # of the end, seen from the beginning


def second(world: World, seconds: float) -> Tracked:
    """What the front end says of a scan without odometry, so many seconds after the first."""
    front, rng = FrontEnd(SETTINGS.front), np.random.default_rng(0)
    front.step(full_scan(world, BEGIN, NOISE, rng))
    return front.step(replace(full_scan(world, END, NOISE, rng), stamp=seconds))


def distance(tie: UncertainPose, pose) -> float:
    """In standard deviations."""
    return float(np.sqrt(squared_mahalanobis(pose_difference(tie.pose, pose), tie.covariance)))


def test_in_a_hall_that_looks_the_same_from_both_ends_a_scan_after_seconds_may_be_at_either():
    """Within three seconds a sensor can have turned around."""
    tracked = second(HALL, 3.0)
    assert not tracked.on
    assert tracked.island
    assert distance(tracked.tie, END - BEGIN) < 2
    assert distance(tracked.tie, MIRRORED) < 2


def test_nothing_turns_around_in_a_tenth_of_a_second():
    tracked = second(HALL, 0.1)
    assert tracked.on
    assert not tracked.island
    assert distance(tracked.tie, MIRRORED) > 100


def test_a_post_that_stands_on_one_side_only_tells_the_ends_apart():
    """It is a hundredth of what is seen: the scan fits both places. But at one of them it stands in free space."""
    tracked = second(WITH_A_POST, 3.0)
    assert tracked.on
    assert distance(tracked.tie, END - BEGIN) < 4
    assert distance(tracked.tie, MIRRORED) > 100


def test_two_places_that_a_scan_fits_wholly_are_as_likely_as_the_guess_has_them():
    expected = expectation(UncertainPose(np.zeros(3), np.eye(3)))
    here, there = (Registration(np.array([x, 0.0, 0.0]), np.eye(3), 1.0) for x in (0.0, 1.0))
    assert expected.likelihood(here, here, 100) == 1
    np.testing.assert_allclose(expected.likelihood(there, here, 100), np.exp(-0.5))
