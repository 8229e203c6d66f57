"""A scan that fits in several ways, some degrees apart, does not claim to be known as well as in one of them."""

import numpy as np
from mapping_scenes import NOISE, SETTINGS, full_scan
from scipy.stats import chi2

from lidarcore import Scan
from lidarcore.geometry import UncertainPose, pose_difference, squared_mahalanobis
from lidarcore.mapping.matching.local_map import LocalMap
from lidarcore.mapping.matching.patches import patches
from lidarcore.mapping.matching.registration import Registration
from lidarcore.simulation import World, furnished_room
from lidarcore.simulation.rooms import rectangular_room

TURNED = 0.15  # rad, standard deviation of what wheels say
TOOTH = 2 * np.pi / 50  # rad


def toothed() -> World:
    """A round room, 3 m to the walls, whose walls are the same every tooth."""
    edges = np.arange(0, 2 * np.pi, TOOTH)
    inner, outer = (r * np.stack([np.cos(edges), np.sin(edges)], -1) for r in (3.0, 3.4))
    slants, sides = np.stack([inner, np.roll(outer, -1, axis=0)], 1), np.stack([outer, inner], 1)
    return World(np.concatenate([slants, sides]))


def registered(world: World, turn: float, guessed: float, rng: np.random.Generator) -> UncertainPose:
    """Of a scan after a turn, on a map of the scan before it."""
    before, after = (
        full_scan(world, np.array([0.0, 0.0, heading]), NOISE, rng) for heading in (0.4, 0.4 + turn)
    )
    local, seen = LocalMap(SETTINGS.front), patches(after, SETTINGS.front.match)
    local.add(before, patches(before, SETTINGS.front.match))
    guess = UncertainPose(np.array([0.0, 0.0, guessed]), np.diag([0.1, 0.1, TURNED]) ** 2)
    expected = local.expects(guess)
    found = local.registered(after, seen, expected)
    tie = local.tie(found)
    return UncertainPose(tie.pose, tie.covariance + local.scatter(seen, expected, found))


def held(world: World, trials: int) -> tuple[float, float]:
    """Share of the turns within their 95 % ellipsoids, and the largest standard deviation of a heading."""
    rng = np.random.default_rng(7)
    turns = rng.normal(0, 0.3, trials)
    found = [registered(world, turn, turn + rng.normal(0, TURNED), rng) for turn in turns]
    off = np.array(
        [pose_difference(one.pose, [0.0, 0.0, turn]) for one, turn in zip(found, turns, strict=True)]
    )
    P = np.array([one.covariance for one in found])
    return float((squared_mahalanobis(off, P) < chi2.isf(0.05, 3)).mean()), float(np.sqrt(P[:, 2, 2].max()))


def test_where_walls_are_the_same_every_few_degrees_a_heading_is_as_vague_as_that():
    """Two other ways in which a scan fits are looked at, not all: some turns lie farther off than these."""
    share, vaguest = held(toothed(), 100)
    assert share > 0.8
    assert vaguest > TOOTH / 2


def test_in_a_room_that_looks_another_way_to_every_side_a_heading_is_known_as_well_as_it_fits():
    share, vaguest = held(furnished_room(), 40)
    assert share > 0.9
    assert vaguest < 0.01


def test_a_scan_that_sees_nothing_near_says_nothing_of_other_ways():
    """What walls far away told of it may not be where the guess has it."""
    scan = full_scan(furnished_room(), np.array([3.0, 3.0, 0.0]), NOISE, np.random.default_rng(1))
    local, guess = LocalMap(SETTINGS.front), UncertainPose(np.zeros(3), np.diag([0.3, 0.3, TURNED]) ** 2)
    local.add(scan, patches(scan, SETTINGS.front.match))
    nothing = patches(Scan(np.full(9, np.nan), np.linspace(0, 1, 9)), SETTINGS.front.match)
    found = Registration(np.array([0.0, 0.0, 0.5]), 1e4 * np.eye(3), 0.5)
    assert np.array_equal(local.scatter(nothing, local.expects(guess), found), np.zeros((3, 3)))


def test_a_corridor_that_looks_the_same_both_ways_leaves_no_heading_as_vague_as_half_a_turn():
    """Without odometry a guess leaves the heading open: half a turn away is another place, and not a vague heading."""
    rng, world = np.random.default_rng(4), rectangular_room(60, 2.4)
    before, after = (full_scan(world, np.array([x, 0.0, 0.0]), NOISE, rng) for x in (0.0, 1.0))
    match = SETTINGS.front.match
    local, seen = LocalMap(SETTINGS.front), patches(after, match)
    local.add(before, patches(before, match))
    expected = local.expects(UncertainPose(np.array([1.0, 0.0, 0.0]), np.diag([0.5, 0.5, 2.5]) ** 2))
    at = local.registered(after, seen, expected)
    less_sure = at._replace(inliers=0.9)  # as if some of what it shows were new
    assert np.sqrt(local.scatter(seen, expected, less_sure)[2, 2]) < 0.05
