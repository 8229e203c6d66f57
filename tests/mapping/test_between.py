"""Covariances of scans between keyframes: algebra in directions that are known, and robots whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.sparse import csc_array

from lidarcore import SensorNoise
from lidarcore.errors import LocalizationError
from lidarcore.evaluation.maps.honesty import drive
from lidarcore.geometry import compose, pose_difference, relative, rotation, squared_mahalanobis
from lidarcore.mapping import Mapper, MapperSettings
from lidarcore.mapping.between import _reduced, _replaced, kept
from lidarcore.mapping.graph.factor import Factor
from lidarcore.mapping.graph.recovery import Recovery
from lidarcore.mapping.graph.refinement import Refined
from lidarcore.mapping.graph.surface_noise import UNMEASURED
from lidarcore.mapping.motion.smoothing import _covered

SETTINGS = MapperSettings().with_noise(SensorNoise(0.01, 0.001))


def turned(angle: float, along: float, across: float, heading: float) -> np.ndarray:
    """Covariance (3, 3) of these variances along a direction, across it and of the heading."""
    C = np.diag([along, across, heading])
    C[:2, :2] = rotation(angle) @ C[:2, :2] @ rotation(angle).T
    return C


@pytest.mark.parametrize("angle", [0.0, 0.7, -2.0])
def test_what_scans_tell_shrinks_and_what_motion_alone_tells_stays(angle):
    """A corridor at an angle, along which scans say nothing; matched has what scans and motion tell."""
    driven = turned(angle, 0.09, 0.04, 0.01)
    by_scans = np.linalg.inv(turned(angle, 1e12, 1e-4, 1e-6))
    matched = np.linalg.inv(np.linalg.inv(driven) + by_scans)
    reduced = _reduced(matched[None], driven[None], 0.2)[0]
    true = np.linalg.inv(np.linalg.inv(driven) + by_scans / 0.2)
    np.testing.assert_allclose(reduced, true, rtol=1e-6, atol=1e-10)
    np.testing.assert_allclose(_reduced(matched[None], driven[None], 1.0)[0], matched, rtol=1e-9, atol=1e-12)


def test_a_pose_that_is_known_less_well_than_by_motion_stays_as_it_is():
    """One that may be in either of two places, say."""
    driven, matched = np.diag([0.01, 0.01, 0.01]), np.diag([4.0, 0.01, 0.01])
    np.testing.assert_allclose(_reduced(matched[None], driven[None], 0.1)[0], matched, rtol=1e-9)


@pytest.mark.parametrize("world", ["corridor", "furnished room"])
def test_scans_between_keyframes_are_as_far_off_as_they_say(world):
    """In units of what is claimed as far as their keyframes, with which they share most: within a quarter.

    As if each scan had an error of its own beside its keyframe's, squares were half as large as claimed.
    """
    squares = {True: [], False: []}
    for seed in range(8):
        scans = drive(world, 8, seed)
        mapper = Mapper(SETTINGS)
        for scan in scans:
            mapper.step(scan)
        mapper.finish()
        true = relative(scans[0].truth, np.array([scan.truth for scan in scans]))
        P = mapper.covariances()
        np.testing.assert_array_equal(P[0], 0)
        np.testing.assert_allclose(P[mapper.keyframes.numbers], mapper.keyframes.covariances)
        of_all = squared_mahalanobis(pose_difference(mapper.trajectory()[1], true)[1:], P[1:])
        is_keyframe = np.isin(np.arange(1, len(scans)), mapper.keyframes.numbers)
        for kind in squares:
            squares[kind].append(of_all[is_keyframe == kind])
    of_keyframes, of_others = (np.concatenate(squares[kind]) for kind in (True, False))
    print(of_keyframes.mean() / 3, of_others.mean() / 3)
    assert 0.75 < of_others.mean() / of_keyframes.mean() < 1.3


def test_a_sensor_that_stands_has_one_keyframe_and_claims_what_each_scan_tells():
    scans = drive("corridor", 0.5, 1)
    still = [replace(scans[0], stamp=0.1 * k, odometry=np.zeros(3)) for k in range(4)]
    mapper = Mapper(SETTINGS)
    for scan in still:
        mapper.step(scan)
    before = mapper.covariances()
    mapper.finish()
    assert len(mapper.keyframes.poses) == 1
    assert np.linalg.eigvalsh(mapper.covariances()[1:]).min() > 0
    np.testing.assert_allclose(
        np.diagonal(mapper.covariances()[1:], 0, 1, 2), np.diagonal(before[1:], 0, 1, 2), rtol=0.5
    )


def test_here_is_where_the_newest_scan_was_placed_and_a_map_without_scans_is_refused():
    mapper = Mapper(SETTINGS)
    with pytest.raises(LocalizationError, match="no scan yet"):
        _ = mapper.here
    for scan in drive("two rooms", 3, 2):
        placed = mapper.step(scan)
        np.testing.assert_allclose(mapper.here.pose, placed.pose, atol=1e-12)
    np.testing.assert_allclose(mapper.here.covariance, mapper.covariances()[-1], rtol=1e-9)
    assert len(mapper.keyframes.poses) > 3


@pytest.mark.parametrize("joined", [[True, True, False], [False, False, False]])
def test_what_the_map_replaces_is_told_by_keyframes_that_surfaces_tie(joined):
    """It moved the second and third by their own deviation each, and left the step to the fourth as it was."""
    local = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])
    poses = local + np.array([[0.0], [0.1], [0.2], [0.2]]) * [1, 1, 0]
    recovery = Recovery(Factor(csc_array(np.eye(12))))
    refined = Refined(poses, np.zeros((4, 3, 3)), np.zeros((4, 2, 3)), np.array(joined), UNMEASURED, recovery)
    share = _replaced(refined, local, np.full((4, 3), 0.1**2 / 2))
    assert share == pytest.approx(2 / 3 if any(joined) else 1)


@pytest.mark.parametrize("joined", [[True, True, False], [False, False, False]])
def test_what_the_map_keeps_of_errors_is_told_by_keyframes_that_surfaces_tie(joined):
    """Poses are known to 1 m and 1 rad, each for itself; the last one is turned, so that its step says otherwise."""
    poses = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 3, 1]])
    scatter = np.array(
        [[0.5, 2, 4]] * 4
    )  # ahead less than the map's own: it has all of the error, and no more
    recovery = Recovery(Factor(csc_array(np.eye(12))))
    refined = Refined(poses, np.zeros((4, 3, 3)), np.zeros((4, 2, 3)), np.array(joined), UNMEASURED, recovery)
    assert kept(refined, scatter) == pytest.approx([1, 0.75, 0.25] if any(joined) else [1, 1, 1])


def test_the_map_keeps_as_much_of_the_errors_of_single_scans_as_it_says():
    """Against how errors of both, of where scans were on average, go together in simulated drives, while the robot goes
    straight on: where it turns, those of its motion come in besides. Of 8 drives that is known to 15 %, of 24 to 8."""
    told, products = [], []
    for seed in range(24):
        mapper, scans = Mapper(SETTINGS), drive("two rooms", 15, seed)
        for scan in scans:
            mapper.step(scan)
        mapper.finish()
        motions = [mapper._motions[number] for number in mapper._numbers]
        scatter = np.array([motion.scatter for motion in motions])
        told.append(kept(mapper._refined, scatter))
        h = np.array([motion.half for motion in motions])
        rates = np.array([[motion.velocity, motion.acceleration] for motion in motions])
        stamps, true = (np.array([getattr(scan, name) for scan in scans]) for name in ("stamp", "truth"))
        true[:, 2] = np.unwrap(true[:, 2])
        way, begin = CubicSpline(stamps, true).antiderivative(), stamps[mapper._numbers][:-1]
        means = (way(begin + 2 * h[:-1]) - way(begin)) / (2 * h[:-1, None])
        errors = []
        for poses in (np.array(mapper._locals), mapper._refined.poses):
            at = compose(poses, _covered(rates, h[:, None]))[:-1]
            errors.append(pose_difference(relative(at[:-1], at[1:]), relative(means[:-1], means[1:])))
        is_steady = np.abs(rates[:-1, :, 2]).max(axis=1) < 0.2
        squares = np.stack([errors[0] * errors[1], scatter[1:-1] + scatter[:-2]])
        products.append(squares[:, is_steady[1:] & is_steady[:-1]])
    together, scattered = np.concatenate(products, axis=1).mean(axis=1)
    print(np.mean(told, 0), together / scattered, sum(one.shape[1] for one in products))
    np.testing.assert_allclose(np.mean(told, 0), together / scattered, rtol=0.2)
