"""The motion within each scan, told by where the scans around it were taken, against motions that are known."""

from dataclasses import replace

import numpy as np
import pytest

from lidarcore import SensorNoise
from lidarcore.evaluation.maps.honesty import drive
from lidarcore.geometry import compose, inverse, pose_difference, relative, rotate
from lidarcore.mapping import Mapper, MapperSettings
from lidarcore.mapping.motion.smoothing import UNTOLD, ScanMotion, smoothed, with_distortion

HALF = 0.05  # s
T = np.arange(40) / 10


def way(t):
    """Poses (T, 3) of a sensor whose turn rate swings by 0.6 rad/s and whose speed by 0.3 m/s."""
    fine = np.linspace(0, 5, 50_001)
    speed, rate = 0.6 + 0.3 * np.sin(1.5 * fine), 0.6 * np.sin(2 * fine)
    heading = np.cumsum(rate) * 1e-4
    x, y = np.cumsum(speed * np.cos(heading)) * 1e-4, np.cumsum(speed * np.sin(heading)) * 1e-4
    return np.stack([np.interp(t, fine, column) for column in (x, y, heading)], -1)


def velocities(t):
    """(T, 3) in the middle of the scan, seen from there."""
    return relative(way(t + HALF - 1e-3), way(t + HALF + 1e-3)) / 2e-3


def motions(removed):
    small, nothing, no_shift = np.full(3, 1e-8), np.zeros((3, 3)), np.zeros((2, 3, 3))
    return [
        ScanMotion(HALF, v, np.zeros(3), small, UNTOLD, small, small, np.eye(3), nothing, no_shift, True)
        for v in removed
    ]


def test_speeds_and_places_are_found_though_each_scan_was_laid_with_the_speed_before_it():
    removed = np.concatenate([np.zeros((1, 3)), velocities(T)[:-1]])
    since = np.linspace(0, 2 * HALF, 101)
    carried = np.mean([relative(way(T), way(T + t)) for t in since], axis=0)  # where its beams lie on average
    laid = compose(way(T), carried - HALF * removed)
    assert np.abs(pose_difference(laid, way(T))).max() > 0.005
    at, after = smoothed(T, laid, motions(removed))
    found = np.array([one.velocity for one in after])
    assert np.abs(found - velocities(T))[2:-2].max() < 0.02
    off = np.abs(pose_difference(at, way(T)))[3:-3]
    assert off.max() < 1e-3
    assert off[:, 2].max() < 2e-4
    true = np.gradient(velocities(T), 0.1, axis=0)
    grows = np.array([one.acceleration for one in after])
    assert np.abs(true[:, [0, 2]]).max() > 0.4
    with_jerk = true - HALF / 2 * np.gradient(true, 0.1, axis=0)  # with which the sweep begins where it began
    assert np.abs(grows - with_jerk)[3:-3].max() < 0.05
    claimed = np.array([np.sqrt(np.diag(one.sweep)) for one in after])
    off = HALF * (found - velocities(T))
    assert (np.abs(off)[:, [0, 2]] < 3 * claimed[:, [0, 2]]).all()


def test_a_pause_makes_no_scan_less_sure_than_the_end_of_a_drive_does():
    half = np.arange(20) / 8  # s, and four seconds later, without rounding
    twice = np.concatenate(
        [way(half), way(half)]
    )  # how jerky a drive is, all of it tells: so it is driven again
    _, after = smoothed(np.append(half, half + 4), twice, 2 * motions(velocities(half)))
    _, ended = smoothed(half, way(half), motions(velocities(half)))
    for one, alone in zip(after, 2 * ended, strict=True):
        np.testing.assert_allclose(one.sweep, alone.sweep, rtol=1e-6, atol=1e-15)


def test_scans_that_lie_on_nothing_and_those_taken_at_once_stay_as_they_were():
    given = motions(velocities(T))
    given[7] = given[7]._replace(on=False)
    given[20] = given[20]._replace(half=0.0)
    laid = way(T)
    laid[7] += [0.3, 0, 0]
    at, after = smoothed(T, laid, given)
    for k in (7, 20):
        assert after[k] is given[k]
        np.testing.assert_allclose(at[k], laid[k], atol=1e-12)
    assert np.abs(pose_difference(at, way(T)))[[5, 6, 8, 9]].max() < 3e-3
    alone, kept = smoothed(T[:1], laid[:1], given[:1])
    assert kept[0] is given[0]
    np.testing.assert_array_equal(alone, laid[:1])


@pytest.mark.parametrize("odometry", [True, False])
def test_a_robot_that_swings_into_a_turn_is_where_the_finished_map_says(odometry):
    """Its turn rate grows by up to 2 rad/s²: by the motion before each scan alone, headings were 3 mrad off."""
    scans = drive("two rooms", 6, seed=4)
    mapper = Mapper(MapperSettings().with_noise(SensorNoise(0.01, 0.001)))
    for scan in scans:
        mapper.step(scan if odometry else replace(scan, odometry=None))
    mapper.finish()
    true = np.array([scans[k].truth for k in mapper.keyframes.numbers])
    off = np.array(
        [
            pose_difference(mapper.relative(k, k + 1).pose, relative(true[k], true[k + 1]))
            for k in range(1, len(true) - 2)
        ]
    )
    assert len(off) > 8
    print(np.sqrt(np.mean(off**2, axis=0)))
    assert np.sqrt(np.mean(off[:, 2] ** 2)) < 0.0025
    smoothed_once = mapper.trajectory()[1]
    mapper.finish()
    np.testing.assert_allclose(mapper.trajectory()[1], smoothed_once, atol=2e-3)


def test_the_first_scan_is_as_far_off_as_its_own_place_and_the_speed_that_this_tells_make_it():
    """150 drives at a constant speed, places off by 1 mm and 1 mrad, which scans claim; where sensors were at stamps.

    As if both errors were independent, the squares were half as large again as claimed.
    """
    rng, sigma = np.random.default_rng(8), 1e-3
    T = np.arange(40) / 10
    steady = np.array([0.5, 0.0, 0.0])
    true = np.outer(T, steady)
    same = np.full(3, sigma**2)
    given = [one._replace(variances=same, own=same) for one in motions(np.tile(steady, (len(T), 1)))]
    ends, between = [], []
    for _ in range(150):
        at, after = smoothed(T, true + rng.normal(0, sigma, true.shape), given)
        for squares, k in ((ends, 0), (between, 6)):
            P = sigma**2 * np.eye(3) + after[k].stands(np.ones(3))
            off = pose_difference(at[k], true[k])
            squares.append(off @ np.linalg.solve(P, off) / 3)
    print(np.mean(ends), np.mean(between))
    assert 0.7 < np.mean(ends) < 1.15
    assert 0.7 < np.mean(between) < 1.15


def test_a_pose_has_what_its_motion_shares_with_as_much_of_the_error_of_its_place_as_the_map_kept():
    """Against the sum of both errors, one dimension kept whole, one in part, one not at all."""
    L, kept = np.random.default_rng(4).normal(size=(6, 9)), np.array([1.0, 0.6, 0.0])
    joint = L @ L.T + 5 * np.eye(6)  # of what the motion does to the pose, and of the error of its place
    both = np.hstack([np.eye(3), np.diag(kept)])
    alone = np.hstack([np.zeros((3, 3)), np.diag(kept)])
    added = both @ joint @ both.T - alone @ joint @ alone.T
    motion = motions(np.zeros((1, 3)))[0]._replace(sweep=joint[:3, :3], shared=joint[:3, 3:])
    assert (np.linalg.eigvalsh(added) > 0).all()
    np.testing.assert_allclose(motion.stands(kept), added)


def test_scans_on_a_map_of_few_claim_its_noise_but_tell_speeds_as_well_as_others():
    """150 drives as above, but of a speed that wanders as that of the steadiest drives does that are expected.

    The first scan is the map, and those after it lie on the noise of that one alone. As if neighbours did not share
    that, squares were half as large as claimed.
    """
    rng, sigma, fine = np.random.default_rng(9), 1e-3, 0.01
    worse = np.where(np.arange(len(T)) < 8, 2.0, 1.0) * (np.arange(len(T)) > 0) * sigma**2
    steady = np.array([0.5, 0.0, 0.0])
    given = [
        one._replace(variances=np.full(3, matched), own=np.full(3, sigma**2))
        for one, matched in zip(motions(np.tile(steady, (len(T), 1))), worse, strict=True)
    ]
    squares = []
    for _ in range(150):
        growing = np.cumsum(rng.normal(0, 0.1 * np.sqrt(fine), 410))  # m/s²: jerk of .1 m/s³ in a second
        speed = 0.5 + np.cumsum(growing) * fine
        x = np.cumsum(speed) * fine
        middle = np.arange(len(T)) * 10 + 5
        mean = np.array([x[k - 5 : k + 6].mean() for k in middle])
        laid = rng.normal(0, sigma, (len(T), 3)) - HALF * steady
        laid[:, 0] += mean
        _, after = smoothed(T, laid, given)
        squares.append((HALF * (after[0].velocity[0] - speed[5])) ** 2 / after[0].sweep[0, 0])
    print(np.mean(squares))
    assert 0.65 < np.mean(squares) < 1.2


def test_a_sensor_tells_its_speed_as_well_while_it_turns_steadily_as_while_it_drives_straight_on():
    """30 drives each at 1 m/s, places off by 1 mm and 1 mrad, at up to 1.5 rad/s.

    As if it had not turned, speeds ahead were off by 5.3 mm/s instead of 2.2, and accelerations by 71 mm/s² instead
    of 22.
    """
    rng, sigma, off = np.random.default_rng(10), 1e-3, {}
    same = np.full(3, sigma**2)
    for rate in (1e-6, 1.5):
        moving = np.array([1.0, 0.0, rate])
        true = np.stack([np.sin(rate * T) / rate, (1 - np.cos(rate * T)) / rate, rate * T], -1)
        given = [one._replace(variances=same, own=same) for one in motions(np.tile(moving, (len(T), 1)))]
        found = []
        for _ in range(30):
            _, after = smoothed(T, true + rng.normal(0, sigma, true.shape), given)
            found += [[one.velocity - moving, one.acceleration] for one in after[5:-5]]
        off[rate] = np.sqrt(np.mean(np.square(found), axis=0))
        print(rate, off[rate])
    assert (off[1.5] < 1.3 * off[1e-6]).all()


@pytest.mark.parametrize("part", [0.3, -0.3])
def test_a_scan_whose_speed_is_told_by_its_own_place_stands_farther_off_or_less_far(part):
    """By the law of sums: its place is wrong by a, and its speed by what takes that much of it back, or adds it."""
    rng = np.random.default_rng(12)
    A, B = (M @ M.T for M in rng.normal(size=(2, 3, 3)))
    B += A  # what is wrong besides is more than what is taken back
    sweep, shared = part**2 * A + B, part * A
    given = motions(np.zeros((1, 3)))[0]._replace(sweep=sweep, shared=shared)
    places = rng.multivariate_normal(np.zeros(3), A, 100_000)
    stands = places + part * places + rng.multivariate_normal(np.zeros(3), B, 100_000)
    told = A + given.stands(1.0)
    np.testing.assert_allclose(np.cov(stands.T), told, atol=0.03 * np.trace(told))


def test_a_scan_never_stands_better_than_its_place_is_known():
    given = motions(np.zeros((1, 3)))[0]._replace(sweep=0.01 * np.eye(3), shared=-0.1 * np.eye(3))
    np.testing.assert_allclose(given.stands(0.5), 0.0, atol=1e-12)


def test_a_sensor_that_swings_into_a_turn_does_not_seem_to_slide():
    """At 1 m/s its turn rate grows by 1.5 rad/s²: with headings told by poses alone, it slides by 1.2 mm/s."""
    fine = np.arange(-500, 15_501) * 1e-4
    heading = 0.75 * fine**2
    x, y = np.cumsum(np.cos(heading)) * 1e-4, np.cumsum(np.sin(heading)) * 1e-4
    middle = np.arange(16) * 1000 + 500
    sweeps = np.array([[column[k - 500 : k + 501].mean() for column in (x, y, heading)] for k in middle])
    true = np.stack([np.ones(16), np.zeros(16), 1.5 * fine[middle]], -1)
    given = motions(true)
    moved = np.column_stack([rotate(HALF / 2 * true[:, 2], HALF * true[:, :2]), HALF * true[:, 2]])
    laid = compose(sweeps, inverse(moved))
    _, after = smoothed(np.arange(16) / 10, laid, given)
    off = np.array([one.velocity for one in after]) - true
    print(off[3:-3])
    assert np.abs(off[3:-3, 1]).max() < 4e-4


def test_what_distortion_tells_of_speeds_counts_as_much_as_it_agrees_with_places():
    """Speeds off by three times what they claim, mostly, claim nine times the variance afterwards; others as before."""
    rng = np.random.default_rng(13)
    given = [one._replace(sweep=np.diag([1e-6, 1e-6, 1e-8])) for one in motions(velocities(T))]
    doubts = np.tile([0.03, 0.03, 0.005], (len(T), 1)) ** 2
    expected = np.sqrt(doubts + np.array([1e-6, 1e-6, 1e-8]) / HALF**2)
    for times in (1.0, 3.0):
        off = times * expected * rng.normal(size=doubts.shape)
        told = np.array([one.distorted for one in with_distortion(given, np.stack([off, doubts], 1))])
        np.testing.assert_allclose(told[:, 0], velocities(T) + off)
        np.testing.assert_allclose(told[:, 1] / doubts, times**2, rtol=0.4)


@pytest.mark.parametrize("odometry", [True, False])
def test_a_drive_that_begins_as_its_turn_becomes_steady_starts_less_far_off(odometry):
    """Its turn rate grew by 0.05 rad/s in the first scan, and in none after it.

    As if places of scans alone told that, the first one lay 2.5 mrad off, nine times as far as claimed.
    """
    seed = int(np.random.SeedSequence([1, 76]).generate_state(1)[0])
    scans = drive("field", 6, seed=seed)
    mapper = Mapper(MapperSettings().with_noise(SensorNoise(0.01, 0.001)))
    for scan in scans:
        mapper.step(scan if odometry else replace(scan, odometry=None))
    mapper.finish()
    true = relative(scans[0].truth, np.array([scan.truth for scan in scans]))
    off = pose_difference(mapper.trajectory()[1], true)[1:, 2]
    claimed = np.sqrt(mapper.covariances()[1:, 2, 2])
    print(np.median(off), np.median(claimed))
    assert np.abs(np.median(off)) < 0.0015
    assert np.median(np.abs(off) / claimed) < 5
