"""Poses found in a known map: branch and bound against brute force, simulated rooms, and a mirror that fools nobody."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from lidarcore import Scan, SensorNoise
from lidarcore.errors import LocalizationError
from lidarcore.geometry import UncertainPose, compose, pose_difference
from lidarcore.mapping.grid import OccupancyGrid, build_grid, read_ros_map, write_ros_map
from lidarcore.mapping.relocation import Relocator, field, query_of
from lidarcore.mapping.relocation.field import FULL, LEVELS, make_field
from lidarcore.mapping.relocation.search import Turned, best_pose, contradicted, fit_at, squares
from lidarcore.simulation import SimulatedSensor, World, furnished_room, random_pose
from lidarcore.simulation.rooms import rectangular_room

NOISE = SensorNoise(0.01, 0.001)


def scan_at(world: World, pose: np.ndarray, seed: int = 0) -> Scan:
    return SimulatedSensor(world, NOISE).scan(pose, np.random.default_rng(seed))[0]


def mapped(world: World, count: int = 40) -> OccupancyGrid:
    rng = np.random.default_rng(3)
    poses = np.array([random_pose(world, rng) for _ in range(count)])
    return build_grid([scan_at(world, pose, k) for k, pose in enumerate(poses)], poses)


@cache
def furnished() -> OccupancyGrid:
    return mapped(furnished_room())


def test_branch_and_bound_finds_what_brute_force_finds():
    rng = np.random.default_rng(1)
    for _ in range(5):
        cells = rng.choice([-1, 0, 100], (60, 75), p=[0.3, 0.62, 0.08]).astype(np.int8)
        field = make_field(OccupancyGrid(cells, 0.05, np.zeros(3)), 0.1)
        points = Turned(*rng.integers(-25, 25, (2, 7, 30)).astype(np.int32))
        fits = {
            (a, x, y): fit_at(field.levels[0], points.columns[a], points.rows[a], x, y, 0)
            for a in range(7)
            for y, x in np.argwhere(field.room[0] > 0).tolist()
        }
        best = max(fits.values())
        height, width = field.room.shape[1:]
        everywhere = (LEVELS - 1, np.arange(7), (0, 0, width, height))
        nodes = squares(field, points, *everywhere, 0)
        none = np.empty((0, 3), np.int32)
        fit, *place = best_pose(field, points, nodes, 1, none, (0, 0))
        assert fit == best == fits[tuple(place)]
        # And the best of the rest, if all within eight cells at angles next to it do not count.
        taken, apart = np.array([place], np.int32), (1, 8)
        rest = max(
            value
            for (a, x, y), value in fits.items()
            if min((a - place[0]) % 7, (place[0] - a) % 7) > 1 or np.hypot(x - place[1], y - place[2]) > 8
        )
        assert best_pose(field, points, nodes, 1, taken, apart)[0] == rest
        assert best_pose(field, points, nodes, best + 1, none, (0, 0))[0] == -1


def test_the_fit_of_a_point_falls_with_its_distance_from_what_stands():
    cells = np.zeros((40, 40), np.int8)
    cells[20, 20] = 100
    field = make_field(OccupancyGrid(cells, 0.05, np.zeros(3)), 0.1)
    row, column = 20 - field.corner[1], 20 - field.corner[0]
    assert field.levels[0][row, column] == FULL
    assert field.levels[0][row, column + 2] == pytest.approx(FULL * np.exp(-0.5), abs=1)
    assert field.levels[3][row - 7, column - 7] == FULL
    assert field.levels[3][row + 1, column] < FULL


def test_poses_in_a_furnished_room_are_found_from_one_scan():
    rng, relocator = np.random.default_rng(7), Relocator(furnished())
    errors, claims = [], []
    for k in range(25):
        pose = random_pose(furnished_room(), rng)
        found = relocator.find(query_of([scan_at(furnished_room(), pose, 100 + k)]))
        if found.found:
            errors.append(pose_difference(found.pose, pose))
            claims.append(np.sqrt(np.diag(found.covariance)))
    assert len(errors) >= 20
    assert np.hypot(*np.array(errors)[:, :2].T).max() < 0.1
    assert np.abs(np.array(errors)[:, 2]).max() < 0.03
    assert (np.abs(errors) < 3 * np.array(claims)).mean() > 0.95


def test_what_is_far_away_in_a_map_changes_nothing():
    own, pose = furnished(), np.array([7.6, 4.4, 1.0])
    around = np.full((own.cells.shape[0] + 2000, own.cells.shape[1] + 1400), -1, np.int8)
    around[1000:-1000, 700:-700] = own.cells
    around[[0, -1]] = 100
    origin = compose(own.origin, np.array([-700, -1000, 0]) * own.resolution)
    guess = UncertainPose(pose, np.diag([0.2, 0.2, 0.1]) ** 2)
    query = query_of([scan_at(furnished_room(), pose)])
    alone = Relocator(own).find_near(query, guess)
    amid = Relocator(OccupancyGrid(around, own.resolution, origin)).find_near(query, guess)
    assert alone.found
    np.testing.assert_allclose(amid.pose, alone.pose, atol=1e-6)
    np.testing.assert_allclose(amid.covariance, alone.covariance, rtol=1e-4)


def test_maps_that_ros_placed_and_turned_are_searched_in_their_world(tmp_path):
    own = furnished()
    shift = np.array([12.0, -7.0, 0.6])
    write_ros_map(OccupancyGrid(own.cells, own.resolution, compose(shift, own.origin)), tmp_path / "m.yaml")
    relocator = Relocator(read_ros_map(tmp_path / "m.yaml"))
    pose = np.array([7.6, 4.4, 1.0])
    found = relocator.find(query_of([scan_at(furnished_room(), pose)]))
    assert found.found
    assert np.abs(pose_difference(found.pose, compose(shift, pose))).max() < 0.08


def test_two_places_that_look_alike_are_none():
    """A rectangle looks the same from the opposite pose."""
    room = rectangular_room(6, 4)
    found = Relocator(mapped(room)).find(query_of([scan_at(room, np.array([1.2, 0.5, 0.3]))]))
    assert found.verdict == "several places"
    assert found.rival > 0.85 * found.fit


def test_other_rooms_are_not_found():
    rng, relocator = np.random.default_rng(8), Relocator(furnished())
    other = World(np.concatenate([rectangular_room(7, 5).walls, [[[-1.0, -2.5], [-1.0, 0.4]]]]))
    for k in range(10):
        assert not relocator.find(query_of([scan_at(other, random_pose(other, rng), k)])).found


def test_keyframes_together_are_laid_as_they_lie_to_each_other():
    room = furnished_room()
    poses = np.array([[7.6, 4.4, 0.0], [7.0, 4.3, 0.5], [6.4, 4.2, 1.0]])
    scans = [scan_at(room, pose, k) for k, pose in enumerate(poses)]
    elsewhere = np.array([compose(np.array([3.0, 9.0, -1.0]), pose) for pose in poses])
    found = Relocator(furnished()).find(query_of(scans, elsewhere))
    assert found.found
    assert np.abs(pose_difference(found.pose, poses[-1])).max() < 0.08


def test_maps_too_large_to_be_searched_at_once_are_searched_in_larger_cells(monkeypatch):
    monkeypatch.setattr(field, "_MOST_CELLS", 50_000)
    own, rng = furnished(), np.random.default_rng(7)
    assert field.searchable(own).resolution >= 2 * own.resolution
    relocator = Relocator(own)
    found = []
    for k in range(10):
        pose = random_pose(furnished_room(), rng)
        place = relocator.find(query_of([scan_at(furnished_room(), pose, 100 + k)]))
        if place.found:
            found.append(pose_difference(place.pose, pose))
    assert len(found) >= 6
    assert np.hypot(*np.array(found)[:, :2].T).max() < 0.15


def test_too_few_points_and_empty_maps_say_so():
    assert Relocator(furnished()).find(query_of([Scan([1.0, 2.0], [0.0, 1.0])])).verdict == "too few points"
    nothing = Scan(np.full(90, np.nan), np.deg2rad(np.arange(90)))
    assert (
        Relocator(furnished()).find_near(query_of([nothing]), guess(np.zeros(3))).verdict == "too few points"
    )
    with pytest.raises(LocalizationError, match="occupied"):
        Relocator(OccupancyGrid(np.zeros((5, 5)), 0.05, np.zeros(3)))
    with pytest.raises(LocalizationError):
        query_of([])


def guess(pose: np.ndarray, sigma: float = 0.1) -> UncertainPose:
    return UncertainPose(pose, np.diag([sigma, sigma, 0.5 * sigma]) ** 2)


def test_near_a_guess_only_places_near_it_are_rivals():
    """A rectangle looks the same from the opposite pose; who knows roughly where the sensor is knows which."""
    room, pose = rectangular_room(6, 4), np.array([1.2, 0.5, 0.3])
    relocator, query = Relocator(mapped(room)), query_of([scan_at(room, pose)])
    near = relocator.find_near(query, guess(pose + np.array([0.2, -0.15, 0.1])))
    assert near.found
    assert np.abs(pose_difference(near.pose, pose)).max() < 0.05
    opposite = compose(np.array([0, 0, np.pi]), pose)
    assert np.abs(pose_difference(relocator.find_near(query, guess(opposite)).pose, opposite)).max() < 0.05
    assert relocator.find_near(query, guess(pose, 3.0)).verdict == "several places"


@pytest.mark.filterwarnings("error")
def test_a_guess_where_the_sensor_is_not_is_contradicted():
    room, pose = furnished_room(), np.array([7.6, 4.4, 1.0])
    relocator, query = Relocator(furnished()), query_of([scan_at(room, pose)])
    there = relocator.find_near(query, guess(pose))
    assert there.found
    for wrong in (
        pose + np.array([-1.5, 0.5, 0.0]),
        pose + np.array([0, 0, 1.5]),
        pose + np.array([40.0, 0.0, 0.0]),
        pose + np.array([1e300, 0.0, 0.0]),
    ):
        found = relocator.find_near(query, guess(wrong))
        assert not found.found
        assert found.fit - found.against < there.fit - there.against - 0.5
    assert relocator.find_near(query_of([Scan([1.0], [0.0])]), guess(pose)).verdict == "too few points"


def test_a_ray_is_contradicted_by_what_it_goes_through_and_not_by_what_it_grazes():
    """A wall along y = 0 and one along x = 5, cells of 5 cm; everything else is free."""
    cells = np.zeros((120, 220), np.int8)
    cells[20, :] = cells[:, 200] = 100
    states = make_field(OccupancyGrid(cells, 0.05, np.zeros(3)), 0.1)
    low = states.corner

    def against(origin: tuple[float, float], end: tuple[float, float]) -> float:
        ends = (np.array([point]) - low for point in (end, origin))
        return contradicted(states.states, *ends)

    assert against((60, 60), (60, 20.5)) == 0  # ends at the wall
    assert against((10, 24), (150, 20.5)) == 0  # grazes it where it ends
    assert against((10, 21), (200.5, 20.5)) == 0  # along it into the corner
    assert against((60, 60), (60, 5)) == 1  # through it into the open
    assert against((60, 60), (120, 60)) == 1  # ends in the open
    assert against((60, 60), (60, 15)) == 0  # just behind it: the map may be that wrong


def test_a_place_that_the_map_contradicts_a_little_more_is_a_rival_still():
    """Two equal rooms, one of them known in part only; what was put into the other since does not make it that one."""
    room = World(np.concatenate([rectangular_room(7, 5).walls, [[[-1.0, -2.5], [-1.0, 0.4]]]]))
    one, pose = mapped(room), np.array([1.5, 0.5, 0.3])
    other = one.cells.copy()
    columns = slice(one.cells_of(pose[None, :2])[0, 1], None)
    other[:, columns] = np.where(other[:, columns] == 0, -1, other[:, columns])
    both = OccupancyGrid(
        np.hstack([one.cells, np.full((len(other), 40), -1), other]), one.resolution, one.origin
    )
    scan = scan_at(room, pose)
    new = np.sin(40 * scan.bearings) > np.cos(0.07 * np.pi)  # 7 % of the beams end in the open
    seen = Scan(np.where(new, 0.6 * scan.ranges, scan.ranges), scan.bearings)
    assert Relocator(both).find(query_of([seen])).verdict in ("several places", "no fit")


@pytest.mark.parametrize(("points", "verdict"), [(45, "too few points"), (150, "found")])
def test_few_points_have_to_fit_better_than_many(points, verdict):
    """A fifth of what is seen has been moved since: of 150 points the rest is enough, of 45 it may be chance."""
    relocator, pose = Relocator(furnished()), random_pose(furnished_room(), np.random.default_rng(8))
    query = query_of([scan_at(furnished_room(), pose)], np.zeros((1, 3)))
    rng = np.random.default_rng(1)
    chosen = query.points[rng.permutation(len(query.points))[:points]]
    assert len(chosen) == points
    moved = np.where(rng.random(points)[:, None] < 0.2, chosen * 0.75, chosen)
    found = relocator.find(replace(query, points=moved))
    assert found.verdict == verdict
    assert found.fit == pytest.approx(0.86, abs=0.03)


def test_what_was_put_into_a_room_is_held_against_a_place_once():
    """A quarter of the beams end before the walls that the map has: three quarters fit, and that is enough."""
    relocator, pose = Relocator(furnished()), np.array([7.6, 4.4, 1.0])
    scan = scan_at(furnished_room(), pose)
    new = np.sin(40 * scan.bearings) > np.cos(0.25 * np.pi)
    query = query_of([Scan(np.where(new, 0.6 * scan.ranges, scan.ranges), scan.bearings)])
    for found in (relocator.find(query), relocator.find_near(query, guess(pose))):
        assert found.found
        assert found.against > 0.15
        assert np.abs(pose_difference(found.pose, pose)).max() < 0.08


def test_a_place_where_half_of_the_rays_go_through_a_wall_of_the_map_is_none():
    """All points lie on walls of the map, but for a partition that it has, and the scan was taken without."""
    room = rectangular_room(10, 6)
    parted = World(np.concatenate([room.walls, [[[0.5, -3], [0.5, 3]], [[0.54, 3], [0.54, -3]]]]))
    rng = np.random.default_rng(5)
    poses = np.array([[x, y, rng.uniform(-3, 3)] for x in (-4, -2.5, -1, 2, 3.5) for y in (-2, 0, 2)])
    relocator = Relocator(build_grid([scan_at(parted, pose, k) for k, pose in enumerate(poses)], poses))
    pose = np.array([-0.5, 0.3, 0.4])
    query = query_of([scan_at(room, pose)])
    found = relocator.find_near(query, guess(pose))
    assert found.verdict == "no fit"
    assert found.fit > 0.9
    assert relocator.find_near(query_of([scan_at(parted, pose)]), guess(pose)).found
