"""Ids of walls while a map grows, bends where a loop closes, and what stands there changes."""

import csv
import io
import json
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from mapping_scenes import BUILDING, NOISE, SETTINGS, drive, full_scan, way

from lidarcore import ExtractionSettings, Scan, SensorNoise
from lidarcore.arrays import Array, Ints
from lidarcore.errors import MeasureError
from lidarcore.geometry import act, compose, inverse
from lidarcore.mapping import Mapper
from lidarcore.mapping.export import walls_csv, walls_geojson
from lidarcore.mapping.grid import build_grid
from lidarcore.mapping.measure import feature, length
from lidarcore.mapping.walls import WallIds, Walls, find_walls
from lidarcore.simulation import World
from lidarcore.simulation.rooms import rectangular_room

EXTRACTION = ExtractionSettings(noise=NOISE)
LARGE = World(BUILDING.walls * 2)
ROOM = rectangular_room(8, 4)
SEGMENTS_OF_A_SCAN = 2**20  # room for them, in the numbers of segments


def scans_of(world: World, poses: Array, seed: int = 1) -> list[Scan]:
    rng = np.random.default_rng(seed)
    return [full_scan(world, pose, NOISE, rng) for pose in poses]


def picture(scans: list[Scan], poses: Array, numbers: Ints | None = None) -> Walls:
    covariances = np.tile(1e-8 * np.eye(3), (len(scans), 1, 1))
    grid = build_grid(scans, poses)
    return find_walls(scans, poses, covariances, grid, extraction=EXTRACTION, numbers=numbers)


def across(n: int, y: float) -> Array:
    return np.column_stack([np.linspace(-2.5, 2.5, n), np.full(n, y), np.linspace(0, 3, n)])


def along_line(walls: Walls, axis: int, value: float) -> dict[int, float]:
    """Lengths by id of walls on the line x = value (axis 0) or y = value (axis 1)."""
    on = np.abs(walls.ends[..., axis] - value).max(axis=1) < 0.1
    return dict(zip(walls.ids[on].tolist(), walls.length[on].tolist(), strict=True))


def true_wall(ends: Array, world: World) -> int | None:
    """Which wall of the world a wall lies on, by most of its length."""
    start, step = world.walls[:, 0], world.walls[:, 1] - world.walls[:, 0]
    long = np.hypot(*step.T)
    along = step / long[:, None]
    from_start = ends - start[:, None]  # (W, 2, 2)
    t = np.sort((from_start * along[:, None]).sum(axis=-1), axis=1)
    beside = np.abs(from_start[..., 1] * along[:, :1] - from_start[..., 0] * along[:, 1:]).max(axis=1)
    shared = np.minimum(t[:, 1], long) - np.maximum(t[:, 0], 0)
    beside[shared < 0.5 * (t[:, 1] - t[:, 0])] = np.inf
    return int(np.argmin(beside)) if beside.min() < 0.3 else None


def short_sighted(world: World, pose: Array, noise: SensorNoise, rng: np.random.Generator) -> Scan:
    """All around, but no farther than 4 m: along a corridor only odometry says how far it went."""
    scan = full_scan(world, pose, noise, rng)
    return replace(scan, ranges=np.where(scan.ranges < 4, scan.ranges, np.nan))


@dataclass
class Drive:
    """What became of the walls of a building in one drive around it, more than once.

    on    by id, the true walls that it was on; None where the map was off by more than 0.3 m, or contradicts itself
    last  ids in the last picture
    bent  m that a wall moved across itself where loops closed
    """

    on: dict[int, set[int | None]]
    last: set[int]
    bent: float


def around(seed: int) -> Drive:
    """Which true wall a wall is, is told by the true pose of a keyframe, wherever the map has it.

    The nearest one and the last one that saw the wall, which may be of another pass, have to tell the same.
    """
    way_there = way(0.5, 1.3) * [2, 2, 1]
    scans = drive(way_there, np.random.default_rng(seed), short_sighted, world=LARGE)
    mapper, ids = Mapper(SETTINGS), WallIds()
    pictures: list[tuple[int, Walls]] = []
    on: dict[int, set[int | None]] = {}
    for k, scan in enumerate(scans):
        mapper.step(scan)
        if k % 4 != 3:
            continue
        known = mapper.keyframes
        grid = build_grid(known.scans, known.poses)
        found = find_walls(known.scans, known.poses, known.covariances, grid, extraction=EXTRACTION)
        walls = ids.identified(found)
        pictures.append((len(mapper.loops), walls))
        for i, (id, ends) in enumerate(zip(walls.ids.tolist(), walls.ends, strict=True)):
            near = int(np.argmin(np.hypot(*(known.poses[:, :2] - ends.mean(axis=0)).T)))
            newest = walls.observations.segment[walls.observations.wall == i].max() // SEGMENTS_OF_A_SCAN
            told = set()
            for node in near, int(np.searchsorted(known.numbers, newest)):
                there = compose(way_there[known.numbers[node]], inverse(known.poses[node]))
                told.add(true_wall(act(there, ends), LARGE))
            on.setdefault(id, set()).add(told.pop() if len(told) == 1 else None)
    bent = [max(moved(a, b)) for (before, a), (after, b) in pairwise(pictures) if after > before]
    return Drive(on, set(pictures[-1][1].ids.tolist()), max(bent))


@pytest.mark.long
def test_walls_of_a_building_keep_their_ids_while_the_map_grows_and_loops_bend_it():
    """What is seen again before the loop closes is there twice, and becomes one with the older id."""
    drives = [around(seed) for seed in range(4)]
    total = 0
    for found in drives:
        on = {id: true - {None} for id, true in found.on.items()}
        assert max(map(len, on.values())) == 1, "an id went from one wall to another"
        for true in set.union(*(on[id] for id in found.last)):
            assert min(id for id in on if true in on[id]) in found.last, f"wall {true} lost its id"
            total += 1
    print(f"{total} walls; bent by {[round(found.bent, 2) for found in drives]} m")
    assert total > 80
    assert max(found.bent for found in drives) > 0.3


def moved(before: Walls, after: Walls) -> list[float]:
    """m across itself, of each wall that is in both."""
    _, i, j = np.intersect1d(before.ids, after.ids, return_indices=True)
    n = np.stack([np.cos(after.alpha[j]), np.sin(after.alpha[j])], -1)
    return np.abs(((before.ends[i].mean(axis=1)) * n).sum(axis=1) - after.r[j]).tolist()


def test_ids_stay_however_far_the_map_bends_and_whatever_was_found_first():
    poses = across(12, -1.0)
    scans = scans_of(ROOM, poses)
    ids = WallIds()
    before = ids.identified(picture(scans[:6], poses[:6]))
    # All is turned by a right angle and moved: where one wall was, another one is.
    elsewhere = compose(np.array([1.0, 5.0, np.pi / 2]), poses)
    after = ids.identified(picture(scans, elsewhere))
    assert len(before) == len(after) == 4
    for axis, at in ((0, 4.0), (0, -4.0), (1, 2.0), (1, -2.0)):
        (old,) = along_line(before, axis, at)
        x, y = act(np.array([1.0, 5.0, np.pi / 2]), np.array([at, 0.0] if axis == 0 else [0.0, at]))
        (new,) = along_line(after, 1 - axis, y if axis == 0 else x)
        assert new == old


@pytest.mark.parametrize("dropped", [[0], [1, 3, 4], [0, 1, 2, 3, 4, 5, 7]])
def test_ids_stay_where_the_map_drops_keyframes_and_bends(dropped: list[int]) -> None:
    """Of many views of a place some are dropped: later keyframes keep their numbers."""
    poses = across(12, -1.0)
    scans = scans_of(ROOM, poses)
    ids = WallIds()
    before = ids.identified(picture(scans[:8], poses[:8]))
    nodes = np.delete(np.arange(12), dropped)
    turn = np.array([1.0, 5.0, np.pi / 2])
    after = ids.identified(picture([scans[node] for node in nodes], compose(turn, poses[nodes]), nodes))
    assert len(before) == len(after) == 4
    for axis, at in ((0, 4.0), (0, -4.0), (1, 2.0), (1, -2.0)):
        x, y = act(turn, np.array([at, 0.0] if axis == 0 else [0.0, at]))
        assert list(along_line(after, 1 - axis, y if axis == 0 else x)) == list(along_line(before, axis, at))


def test_walls_that_become_one_keep_the_older_id_and_the_other_is_never_used_again():
    screen = np.array([[[-0.8, 1.0], [0.8, 1.0]]])
    world = World(np.concatenate([ROOM.walls, screen]))
    hidden = np.column_stack([np.zeros(6), np.linspace(-1.2, -0.6, 6), np.zeros(6)])
    behind = np.column_stack([np.linspace(-1.5, 1.5, 6), np.full(6, 1.5), np.zeros(6)])
    poses = np.concatenate([hidden, behind])
    scans, ids = scans_of(world, poses), WallIds()
    two = along_line(ids.identified(picture(scans[:6], hidden)), 1, 2.0)
    assert len(two) == 2
    whole = ids.identified(picture(scans, poses))
    one = along_line(whole, 1, 2.0)
    assert list(one) == [min(two)]
    assert one[min(two)] > sum(two.values())
    assert max(two) not in whole.ids


def test_of_a_wall_that_a_door_cuts_the_longer_part_keeps_the_id():
    leaf = np.array([[[1.8, -2.0], [1.8, 0.2]], [[1.8, 0.2], [1.8, 1.0]], [[1.8, 1.0], [1.8, 2.0]]])
    poses = across(10, 0.0) * [0.5, 1, 1]
    closed = scans_of(World(np.concatenate([ROOM.walls, leaf])), poses)
    opened = scans_of(World(np.concatenate([ROOM.walls, leaf[[0, 2]]])), np.repeat(poses, 2, axis=0), 2)
    ids = WallIds()
    before = ids.identified(picture(closed, poses))
    (whole,) = along_line(before, 0, 1.8)
    after = ids.identified(picture(closed + opened, np.concatenate([poses, np.repeat(poses, 2, axis=0)])))
    parts = along_line(after, 0, 1.8)
    assert len(parts) == 2
    assert max(parts, key=parts.__getitem__) == whole
    (new,) = set(parts) - {whole}
    assert new not in before.ids


def test_a_wall_that_was_away_comes_back_with_its_id():
    board, other = np.array([[[-0.5, 1.3], [0.7, 1.3]]]), np.array([[[1.6, -1.2], [-1.6, -1.2]]])
    poses = across(8, 0.0)
    first = scans_of(World(np.concatenate([ROOM.walls, board])), poses)
    then = scans_of(World(np.concatenate([ROOM.walls, other])), poses, 2)
    again = scans_of(World(np.concatenate([ROOM.walls, board, other])), poses, 3)
    ids, stages = WallIds(), []
    scans: list[Scan] = []
    for more in (first, then + then, again + again + again):
        scans += more
        stages.append(ids.identified(picture(scans, np.tile(poses, (len(scans) // len(poses), 1)))))
    (id,) = along_line(stages[0], 1, 1.3)
    assert not along_line(stages[1], 1, 1.3)
    assert id not in stages[1].ids
    assert list(along_line(stages[2], 1, 1.3)) == [id]


def test_files_and_measurements_name_walls_by_their_ids():
    poses = across(8, 0.0)
    found = picture(scans_of(ROOM, poses), poses)
    walls = replace(found, ids=found.ids + 4)
    rows = csv.DictReader(io.StringIO(walls_csv(walls)))
    assert [int(row["id"]) for row in rows] == [4, 5, 6, 7]
    features = json.loads(walls_geojson(walls))["features"]
    names = {f"wall-{id}" for id in range(4, 8)}
    assert {one["id"] for one in features if one["geometry"]["type"] == "LineString"} == names
    corners = [one["properties"]["walls"] for one in features if one["geometry"]["type"] == "Point"]
    assert len(corners) == 4
    assert {name for pair in corners for name in pair} == names
    assert length(walls, feature("wall-6").index).value == walls.length[2]
    with pytest.raises(MeasureError, match="wall-0"):
        length(walls, 0)
