"""Occupancy grids against rays cast in plain Python, and rooms that change."""

import numpy as np
import pytest

from lidarcore import Scan, SensorNoise
from lidarcore.errors import GridError
from lidarcore.mapping.grid import FREE, OCCUPIED, GridBuilder, GridSettings, OccupancyGrid, build_grid
from lidarcore.simulation import SimulatedSensor, World
from lidarcore.simulation.rooms import rectangular_room

NOISE = SensorNoise(0.005, 0.0005)


def scans_of(world: World, poses: np.ndarray, seed: int = 1) -> list[Scan]:
    rng = np.random.default_rng(seed)
    return [SimulatedSensor(world, NOISE).scan(pose, rng)[0] for pose in poses]


def inside(n: int = 8) -> np.ndarray:
    return np.column_stack([np.linspace(-2, 2, n), np.linspace(-0.7, 0.9, n), np.linspace(0, 3, n)])


def test_cells_of_one_scan_are_those_its_rays_go_through():
    rng = np.random.default_rng(2)
    pose = np.array([0.31, -0.22, 0.4])
    scan = Scan(rng.uniform(0.5, 6, 60), np.linspace(-3, 3, 60))
    grid = build_grid([scan], pose[None])
    angles = scan.bearings + pose[2]
    free, hits = set(), set()
    for r, a in zip(scan.ranges, angles, strict=True):
        way = pose[:2] + np.arange(0, r, 0.0005)[:, None] * [np.cos(a), np.sin(a)]
        free |= set(map(tuple, np.floor(way / 0.05).astype(int)))
        hits.add(tuple(np.floor((pose[:2] + r * np.array([np.cos(a), np.sin(a)])) / 0.05).astype(int)))
    found = {
        state: set(map(tuple, np.floor(grid.centres(grid.cells == state) / 0.05).astype(int)))
        for state in (FREE, OCCUPIED)
    }
    assert found[OCCUPIED] == hits
    # Sampled rays miss corners of cells that they cut by less than half a millimetre.
    assert free - hits <= found[FREE]
    assert len(found[FREE] - free) <= 0.01 * len(free)


def test_a_room_is_free_inside_and_unknown_outside():
    poses = inside()
    grid = build_grid(scans_of(rectangular_room(6, 4), poses), poses)
    x, y = np.meshgrid(np.arange(-2.85, 2.9, 0.1), np.arange(-1.85, 1.9, 0.1))
    assert (grid.at(np.stack([x.ravel(), y.ravel()], -1)) == FREE).mean() > 0.999
    walls = grid.centres(grid.occupied)
    beside = np.minimum(np.abs(np.abs(walls[:, 0]) - 3), np.abs(np.abs(walls[:, 1]) - 2))
    assert beside.max() < 0.06
    assert (grid.at(np.array([[3.5, 0], [0, 2.5], [-9, 0]])) == -1).all()


def test_growing_grids_are_those_made_at_once():
    poses = inside(300)
    scans = scans_of(rectangular_room(6, 4), poses[::30]) * 30
    builder = GridBuilder()
    for scan, pose in zip(scans, poses, strict=True):
        builder.add(scan, pose + np.array([0.02, 0, 0]))
    builder.clear()
    for scan, pose in zip(scans, poses, strict=True):
        builder.add(scan, pose)
    once = build_grid(scans, poses)
    np.testing.assert_array_equal(builder.grid().cells, once.cells)
    np.testing.assert_array_equal(builder.grid().origin, once.origin)


def test_what_has_left_does_not_stay_and_an_open_door_is_free():
    room = rectangular_room(6, 4)
    chair = np.array([[[0.0, 1.0], [0.4, 1.0]]])
    door = np.array([[[1.5, -2.0], [1.5, 2.0]]])
    poses = inside(20) * [0.5, 1, 1]
    before = scans_of(World(np.concatenate([room.walls, chair, door])), poses[:8])
    after = scans_of(room, poses)
    spots = np.array([[0.2, 1.01], [1.51, 0.3]])
    assert (build_grid(before, poses[:8]).at(spots) == OCCUPIED).all()
    changed = build_grid([*before, *after], np.concatenate([poses[:8], poses]))
    assert (changed.at(spots) == FREE).all()
    assert (changed.at(np.array([[2.98, 0.2], [-3.01, 0.2]])) == OCCUPIED).any()


def test_a_wall_seen_at_a_grazing_angle_keeps_its_cells():
    """From up to 17 m; from farther away, single rays that are half a cell off do erode it."""
    room = rectangular_room(20, 2)
    poses = np.column_stack([np.linspace(-9, 9, 60), np.full(60, 0.55), np.zeros(60)])
    shaken = poses + np.random.default_rng(3).normal(0, [0.015, 0.015, 0.002], poses.shape)
    grid = build_grid(scans_of(room, poses), shaken)
    x = np.arange(-8, 8, 0.025)
    near = np.stack([grid.at(np.column_stack([x, np.full(len(x), y)])) for y in (0.97, 1.02)])
    assert (near == OCCUPIED).any(axis=0).mean() > 0.98


def test_a_grid_too_large_is_refused_and_stays_as_it_was():
    builder = GridBuilder(GridSettings(most_cells=200_000))
    scan = scans_of(rectangular_room(6, 4), np.zeros((1, 3)))[0]
    builder.add(scan, np.zeros(3))
    cells = builder.grid().cells
    with pytest.raises(GridError, match="cells"):
        builder.add(scan, np.array([40_000.0, 30_000.0, 0.0]))
    np.testing.assert_array_equal(builder.grid().cells, cells)


@pytest.mark.parametrize("pose", [[0, 0], [0, 0, np.nan], [np.inf, 0, 0]])
def test_poses_that_are_none_are_refused(pose):
    with pytest.raises(GridError):
        GridBuilder().add(Scan([1.0], [0.0]), np.array(pose))


def test_a_scan_without_returns_says_nothing():
    builder = GridBuilder()
    builder.add(Scan([np.nan, np.inf], [0.0, 0.1]), np.zeros(3))
    with pytest.raises(GridError, match="empty"):
        builder.grid()


def test_the_extent_is_that_of_what_is_known_however_the_grid_lies():
    cells = np.full((40, 60), -1)
    cells[10, 20], cells[29, 49] = OCCUPIED, FREE
    upright = OccupancyGrid(cells, 0.1, np.array([-1.0, 2.0, 0.0]))
    np.testing.assert_allclose(upright.extent, [[1, 4], [3, 5]])
    turned = OccupancyGrid(cells, 0.1, np.array([-1.0, 2.0, np.pi / 2]))
    np.testing.assert_allclose(turned.extent, [[-4, -2], [4, 7]])
    assert OccupancyGrid(np.full((3, 3), -1), 0.1, np.zeros(3)).extent is None


def test_larger_cells_hold_what_stands_in_any_and_else_what_is_free_in_any():
    rng = np.random.default_rng(4)
    cells = rng.choice([-1, -1, 0, 10, 50, 70, 100], (7, 11), p=[0.3, 0.2, 0.2, 0.1, 0.1, 0.05, 0.05])
    grid = OccupancyGrid(cells, 0.05, np.array([1.0, 2.0, 0.3]))
    coarse = grid.coarser(3)
    assert coarse.resolution == pytest.approx(0.15)
    assert coarse.cells.shape == (3, 4)
    assert (coarse.origin == grid.origin).all()
    for row in range(3):
        for column in range(4):
            block = cells[3 * row : 3 * row + 3, 3 * column : 3 * column + 3]
            known = block[block >= 0]
            expected = -1 if not len(known) else known.max() if known.max() >= 65 else known.min()
            assert coarse.cells[row, column] == expected
