"""Walls of simulated rooms, whose truth is known, with poses that err together as their covariance says."""

from functools import cache

import numpy as np
import pytest
from chance import SURE
from scipy.stats import binom, chi2

from lidarcore import ExtractionSettings, Scan, SensorNoise
from lidarcore.errors import CovarianceError
from lidarcore.evaluation.maps.walls import Found, compare_with_truth, wall_rooms
from lidarcore.mapping.grid import build_grid
from lidarcore.mapping.walls import Walls, common_spread, find_walls, joint_spread
from lidarcore.simulation import SimulatedSensor, World
from lidarcore.simulation.rooms import rectangular_room

NOISE = SensorNoise(0.01, 0.001)
SETTINGS = ExtractionSettings(noise=NOISE)


def scans_of(world: World, poses: np.ndarray, seed: int = 1) -> list[Scan]:
    rng = np.random.default_rng(seed)
    return [SimulatedSensor(world, NOISE).scan(pose, rng, float(k))[0] for k, pose in enumerate(poses)]


def mapped(world: World, poses: np.ndarray, spread=None, seed: int = 1) -> Walls:
    scans = scans_of(world, poses, seed)
    spread = common_spread(np.tile(1e-8 * np.eye(3), (len(poses), 1, 1))) if spread is None else spread
    return find_walls(scans, poses, spread, build_grid(scans, poses), extraction=SETTINGS)


def across(n: int = 12) -> np.ndarray:
    return np.column_stack([np.linspace(-2, 2, n), np.linspace(-0.7, 0.9, n), np.linspace(0, 3, n)])


@cache
def rooms() -> list[Found]:
    return [compare_with_truth(*room) for room in wall_rooms(seeds=6)]


def test_walls_are_found_once():
    once = np.concatenate([found.times for found in rooms()]) == 1
    assert len(once) > 200
    assert once.mean() >= 0.98


def test_lines_are_where_their_covariances_say():
    distances = np.concatenate([found.line_chi2 for found in rooms()])
    _hold(distances < chi2.ppf(0.95, 2))


def test_lengths_are_what_their_variances_say():
    z = np.concatenate([found.length_z for found in rooms()])
    _hold(np.abs(z) < 1.96)


def _hold(inside: np.ndarray) -> None:
    """Between what 90 and 98.5 per cent give with a probability of one in a million."""
    n = len(inside)
    assert binom.ppf(1e-6, n, 0.90) <= inside.sum() <= binom.ppf(1 - 1e-6, n, 0.985)
    assert inside.sum() >= binom.ppf(1e-3, n, 0.93)


@pytest.mark.parametrize("beams", [90, 180, 360])
def test_who_stands_has_the_walls_around_whole(beams):
    """One scan whose beams are farther apart than the cells of the grid; each end is a beam short at most."""
    room, poses = rectangular_room(8, 5), np.array([[0.4, 0.3, 0.2]])
    whole = scans_of(room, poses)[0]
    kept = np.arange(0, len(whole), len(whole) // beams)
    scan = Scan(whole.ranges[kept], whole.bearings[kept])
    walls = find_walls([scan], poses, np.zeros((1, 3, 3)), build_grid([scan], poses), extraction=SETTINGS)
    assert len(walls) == 4
    assert walls.length.sum() > 2 * (8 + 5) - 8 * 5 * 2 * np.pi / beams


def test_four_walls_make_four_corners():
    walls = mapped(rectangular_room(6, 4), across())
    assert len(walls) == 4
    assert walls.in_corner.all()
    np.testing.assert_allclose(np.sort(walls.length), [4, 4, 6, 6], atol=0.02)
    assert len(walls.corners) == 4
    np.testing.assert_allclose(np.abs(walls.corners.xy), [[3, 2]] * 4, atol=0.015)
    assert (walls.count == 12).all()
    assert (walls.first_seen == 0).all()
    assert (walls.last_seen == 11).all()


def test_who_looks_along_a_wall_has_the_free_side_on_the_left():
    walls = mapped(rectangular_room(6, 4), across())
    along = walls.ends[:, 1] - walls.ends[:, 0]
    to_middle = -walls.ends[:, 0]
    assert (along[:, 0] * to_middle[:, 1] - along[:, 1] * to_middle[:, 0] > 0).all()


def test_both_faces_of_a_wall_between_rooms_are_walls():
    outline = rectangular_room(8, 4).walls
    panel = np.array([[[-0.06, -0.8], [-0.06, 0.8]], [[0.06, 0.8], [0.06, -0.8]]])
    poses = np.array([[-2, 0.3, 0], [-1.5, -1.4, 0.4], [2, -0.2, 1], [1.5, 1.4, 2]])
    walls = mapped(World(np.concatenate([outline, panel])), np.repeat(poses, 3, axis=0))
    faces = walls.ends[np.abs(walls.ends[..., 0]).max(axis=1) < 0.1]
    assert len(faces) == 2
    assert np.abs(np.sort(faces[..., 0].mean(axis=1)) - [-0.06, 0.06]).max() < 0.01


def test_free_ends_lie_between_the_beams_that_meet_them_and_those_that_pass():
    """An end at the last beam that met it would make each panel shorter by four to seven standard deviations."""
    spans = np.array([[-3.31, -2.12], [-1.27, -0.2], [0.4, 1.53], [2.07, 3.36]])
    panels = np.stack([spans, np.full((4, 2), 0.5)], -1)
    poses = np.column_stack([np.linspace(-2.4, 2.4, 15), np.full(15, -1.4), np.zeros(15)])
    walls = mapped(World(np.concatenate([rectangular_room(8, 6).walls, panels])), poses)
    free = np.flatnonzero(np.abs(walls.ends[..., 1] - 0.5).max(axis=1) < 0.1)
    free = free[np.argsort(walls.ends[free, :, 0].min(axis=1))]
    assert walls.ended[free].all()
    assert not walls.in_corner[free].any()
    sigma = np.sqrt(walls.length_variance[free])
    assert sigma.max() < 0.01
    off = (walls.length[free] - np.diff(spans)[:, 0]) / sigma
    assert np.abs(off).max() < SURE
    assert abs(off.mean()) < SURE / 2


def test_a_door_that_opened_cuts_the_wall_and_one_that_is_closed_does_not():
    room, poses = rectangular_room(6, 4), across(10) * [0.5, 1, 1]
    leaf = np.array([[[1.8, -2.0], [1.8, -0.5]], [[1.8, -0.5], [1.8, 0.5]], [[1.8, 0.5], [1.8, 2.0]]])
    closed = World(np.concatenate([room.walls, leaf]))
    opened = World(np.concatenate([room.walls, leaf[[0, 2]]]))
    before, after = scans_of(closed, poses), scans_of(opened, np.repeat(poses, 2, axis=0), 2)

    def lengths(scans, poses):
        tight = np.tile(1e-8 * np.eye(3), (len(poses), 1, 1))
        walls = find_walls(scans, poses, tight, build_grid(scans, poses), extraction=SETTINGS)
        return np.sort(walls.length[np.abs(walls.ends[..., 0] - 1.8).max(axis=1) < 0.05])

    np.testing.assert_allclose(lengths(before, poses), [4.0], atol=0.05)
    both = lengths([*before, *after], np.concatenate([poses, np.repeat(poses, 2, axis=0)]))
    np.testing.assert_allclose(both, [1.5, 1.5], atol=0.08)


def test_what_left_is_no_wall():
    room, poses = rectangular_room(6, 4), across(10)
    board = np.array([[[-0.3, 1.3], [0.5, 1.3]]])
    scans = scans_of(World(np.concatenate([room.walls, board])), poses) + scans_of(
        room, np.repeat(poses, 2, axis=0), 2
    )
    poses = np.concatenate([poses, np.repeat(poses, 2, axis=0)])
    tight = np.tile(1e-8 * np.eye(3), (len(poses), 1, 1))
    assert len(find_walls(scans, poses, tight, build_grid(scans, poses), extraction=SETTINGS)) == 4


def test_common_errors_move_walls_and_leave_lengths():
    poses = across()
    one = np.diag([0.3, 0.3, 1e-9]) ** 2
    walls = mapped(rectangular_room(6, 4), poses, common_spread(np.tile(one, (len(poses), 1, 1))))
    np.testing.assert_allclose(np.sqrt(walls.line_covariance[:, 1, 1]), 0.3, rtol=0.01)
    assert np.sqrt(walls.length_variance).max() < 0.01


def test_spreads_are_covariances_of_what_poses_do():
    from scipy.sparse import csr_array

    rng = np.random.default_rng(4)
    root = rng.normal(size=(12, 12))
    M = csr_array(rng.normal(size=(5, 12)) * (rng.random((5, 12)) < 0.5))
    np.testing.assert_allclose(joint_spread(root @ root.T)(M), M @ (root @ root.T) @ M.T.toarray())
    single = (root @ root.T)[:3, :3]
    shared = np.kron(np.ones((4, 4)), single)  # the same error of all four poses
    np.testing.assert_allclose(
        common_spread(np.tile(single, (4, 1, 1)))(M), M @ shared @ M.T.toarray(), atol=1e-10
    )


@pytest.mark.parametrize("wrong", [np.eye(3), -np.eye(3)[None], np.full((2, 3, 3), np.nan)])
def test_covariances_that_are_none_are_refused(wrong):
    with pytest.raises(CovarianceError):
        common_spread(wrong)


def test_nothing_seen_is_no_wall():
    scans = [Scan([1.0, np.nan, 2.0], [0.0, 0.1, 0.2])]
    walls = find_walls(scans, np.zeros((1, 3)), np.zeros((1, 3, 3)), build_grid(scans, np.zeros((1, 3))))
    assert len(walls) == 0
    assert len(walls.corners) == 0
