"""What comes and goes around a sensor that stands changes its map, live and from a recording."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mapping_scenes import NOISE, SETTINGS, full_scan
from waiting import wait_until

from lidarcore import ExtractionSettings, Scan, open_recording
from lidarcore.arrays import Array
from lidarcore.mapping import Mapper, WholeScans
from lidarcore.mapping.grid import OccupancyGrid, build_grid
from lidarcore.mapping.walls import Walls, find_walls
from lidarcore.simulation import World
from lidarcore.simulation.rooms import rectangular_room

ROOM = rectangular_room(8, 4)
DOOR = np.array([[1.0, -0.5], [1.0, 0.5]])  # m, across what is behind it
STANDS = np.zeros(3)


def watched(seconds: int, opens: int, seed: int = 0, closes: int = 10**9) -> list[Scan]:
    """Two scans a second of a sensor that stands, of a door that is open between two numbers of scans."""
    rng, closed = np.random.default_rng(seed), World(np.concatenate([ROOM.walls, DOOR[None]]))
    scans = []
    for number in range(2 * seconds):
        world = ROOM if opens <= number < closes else closed
        scans.append(replace(full_scan(world, STANDS, NOISE, rng), stamp=number / 2))
    return scans


def mapped(scans: list[Scan]) -> Mapper:
    mapper = Mapper(SETTINGS)
    for scan in scans:
        mapper.step(scan)
    mapper.finish()
    return mapper


def picture(mapper: Mapper) -> tuple[OccupancyGrid, Walls]:
    views = mapper.views
    grid = build_grid(views.scans, views.poses)
    return grid, find_walls(
        views.scans, views.poses, views.covariances, grid, extraction=ExtractionSettings(noise=NOISE)
    )


def across_the_door(grid: OccupancyGrid) -> Array:
    """Cells along the middle of the door."""
    return grid.at(np.stack([np.full(9, DOOR[0, 0]), np.linspace(-0.3, 0.3, 9)], -1))


def behind_the_door(walls: Walls) -> Array:
    """Whether each wall is the door."""
    return np.all(np.abs(walls.ends[..., 0] - DOOR[0, 0]) < 0.1, axis=1)


def test_a_door_that_was_opened_is_free_and_no_wall() -> None:
    mapper = mapped(watched(20, opens=4))
    grid, walls = picture(mapper)
    assert len(mapper.keyframes.numbers) <= 2
    assert (across_the_door(grid) == 0).all()
    assert not behind_the_door(walls).any()


def test_a_door_that_was_closed_is_a_wall() -> None:
    grid, walls = picture(mapped(watched(30, opens=0, closes=30)))
    assert (across_the_door(grid) > 50).any(axis=0).all()
    assert behind_the_door(walls).sum() == 1


def test_the_map_does_not_grow_with_the_time_that_it_watches() -> None:
    views = mapped(watched(60, opens=0)).views
    assert views.numbers.tolist() == [0, *range(102, 120, 2)]
    assert len(views.scans) == len(views.poses) == len(views.covariances) == 10


def test_who_moves_on_gives_keyframes_only() -> None:
    rng = np.random.default_rng(2)
    poses = np.stack([np.linspace(-3, 3, 61), np.zeros(61), np.zeros(61)], -1)
    scans = [replace(full_scan(ROOM, pose, NOISE, rng), stamp=float(k)) for k, pose in enumerate(poses)]
    mapper = mapped(scans)
    np.testing.assert_array_equal(mapper.views.numbers, mapper.keyframes.numbers)
    np.testing.assert_allclose(mapper.views.poses, mapper.keyframes.poses, atol=1e-12)


def test_a_live_map_shows_it_within_ten_seconds_and_keeps_walls_that_were_seen_three_times() -> None:
    kept: list[tuple[OccupancyGrid, Walls]] = []
    extraction = ExtractionSettings(noise=NOISE)
    with closing(WholeScans(extraction, begin_map=lambda: lambda *map: kept.append(map))) as slam:
        for scan in watched(20, opens=20):
            slam.step(slam.deskewed(scan))
        wait_until(lambda: not slam.is_behind)
        wait_until(lambda: bool((across_the_door(slam.picture.grid) == 0).all()))
    grid, walls = kept[-1]
    assert (across_the_door(grid) == 0).all()
    assert not behind_the_door(walls).any()
    longest = walls.count[np.argsort(walls.length)[-4:]]
    assert (longest >= 3).all()


@pytest.mark.real_data
def test_a_real_room_is_mapped_whole_while_the_sensor_stands(data: Path) -> None:
    """Beams of a real RPLIDAR fall elsewhere in each revolution: of what they hit, one of them sees a part."""
    mapper = mapped(list(open_recording(data / "rplidar_csv_rooms" / "golf_room.csv.gz")))
    first = mapper.keyframes
    assert len(first.scans) == 1
    once, grid = build_grid(first.scans, first.poses), picture(mapper)[0]
    assert grid.free.sum() > 1.5 * once.free.sum()
    assert grid.occupied.sum() > 3 * once.occupied.sum()
