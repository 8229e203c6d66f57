"""Walls that were kept are measured as those that they come from, and what is damaged is not measured."""

import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from lidarcore import ExtractionSettings, SensorNoise
from lidarcore.errors import MapFileError, MeasureError
from lidarcore.mapping.export import COVARIANCE_FILE, read_walls, walls_csv, write_map
from lidarcore.mapping.grid import OccupancyGrid, build_grid
from lidarcore.mapping.measure import Feature, angle, distance, length
from lidarcore.mapping.walls import (
    MOST_WALLS,
    JointWalls,
    Walls,
    WallTable,
    find_walls,
    joint_spread,
    pack_covariance,
    unpack_covariance,
)
from lidarcore.simulation import SimulatedSensor
from lidarcore.simulation.rooms import rectangular_room

NOISE = SensorNoise(0.01, 0.001)
SINGLE = 1e-5  # relative: some roundings of float32
Room = tuple[OccupancyGrid, Walls]


@pytest.fixture(scope="module")
def room() -> Room:
    """Each pose has an error of its own, and all share one of 2 cm, which distances do not have."""
    rng = np.random.default_rng(4)
    poses = np.column_stack([np.linspace(-2, 2, 8), np.linspace(-0.7, 0.9, 8), np.linspace(0, 3, 8)])
    own, shared = np.diag([0.01, 0.01, 0.002]) ** 2, np.diag([0.02, 0.02, 1e-9]) ** 2
    spread = joint_spread(np.kron(np.eye(8), own) + np.kron(np.ones((8, 8)), shared))
    sensor = SimulatedSensor(rectangular_room(6, 4), NOISE)
    scans = [sensor.scan(pose, rng, float(k))[0] for k, pose in enumerate(poses)]
    grid = build_grid(scans, poses)
    found = find_walls(scans, poses, spread, grid, extraction=ExtractionSettings(noise=NOISE))
    return grid, replace(found, ids=np.array([4, 9, 2, 30][: len(found)]))


def table(walls: WallTable, which: np.ndarray | None = None) -> WallTable:
    """What is known of walls each for itself."""
    columns = (getattr(walls, name) for name in WallTable.__dataclass_fields__)
    return WallTable(*(column if which is None else column[which] for column in columns))


def kept(walls: JointWalls, which: np.ndarray | None = None) -> JointWalls:
    """Walls as they are read again, each to float64 and together to float32."""
    packed = pack_covariance(walls, which)
    assert packed is not None
    return unpack_covariance(packed, table(walls, which))


def corners(walls: JointWalls, at: np.ndarray) -> Iterator[Feature]:
    for place in at:
        yield Feature("corner", int(np.hypot(*(walls.corners.xy - place).T).argmin()))


def assert_same(found: JointWalls, walls: JointWalls, ids: list[int]) -> None:
    """All that can be measured between them is the same."""
    places = found.corners.xy
    first = [*(Feature("wall", id) for id in ids), *corners(found, places)]
    other = [*(Feature("wall", id) for id in ids), *corners(walls, places)]
    for one, two in combinations(range(len(first)), 2):
        truth = distance(walls, other[one], other[two])
        measured = distance(found, first[one], first[two])
        assert measured.value == pytest.approx(truth.value, abs=1e-9)
        assert measured.sigma == pytest.approx(truth.sigma, rel=1e-3, abs=SINGLE * 0.02)
    for one, two in combinations(first[: len(ids)], 2):
        turn, truth = angle(found, one, two), angle(walls, one, two)
        assert (turn.value, turn.sigma) == pytest.approx((truth.value, truth.sigma), rel=1e-3)
    assert [length(found, id) for id in ids] == [length(walls, id) for id in ids]


def test_kept_walls_are_measured_as_those_they_come_from(room: Room) -> None:
    _, walls = room
    assert len(walls) == len(walls.corners) == 4
    again = kept(walls)
    assert len(again.corners) == 4  # each once, though two walls end there
    assert_same(again, walls, walls.ids.tolist())
    C = walls.model.covariance(walls.model.ends_of(*range(4)))
    np.testing.assert_allclose(
        again.model.covariance(again.model.ends_of(*range(4))), C, rtol=1e-6, atol=1e-12
    )
    at = [np.hypot(*(walls.corners.xy - place).T).argmin() for place in again.corners.xy]
    for k, row in enumerate(at):
        own = again.model.covariance(again.corners.rows_of(k))
        np.testing.assert_allclose(own, walls.corners.covariance[row], rtol=1e-5, atol=1e-10)


def test_what_walls_share_does_not_count_twice(room: Room) -> None:
    """Alone, each would be off by the 2 cm that all share."""
    _, walls = room
    again = kept(walls)
    opposite = [
        (a, b) for a, b in combinations(walls.ids.tolist(), 2) if np.isclose(*lines(walls, a, b), atol=0.1)
    ]
    assert len(opposite) == 2
    for a, b in opposite:
        assert distance(again, Feature("wall", a), Feature("wall", b)).sigma < 0.012


def lines(walls: WallTable, a: int, b: int) -> tuple[float, float]:
    one, other = (walls.alpha[walls.ids == id][0] % np.pi for id in (a, b))
    return float(np.cos(2 * one)), float(np.cos(2 * other))


def test_some_of_the_walls_are_kept_without_the_others(room: Room) -> None:
    _, walls = room
    which = np.array([True, False, True, True])
    again = kept(walls, which)
    assert_same(again, walls, walls.ids[which].tolist())
    with pytest.raises(MeasureError, match=f"no wall-{walls.ids[1]}"):
        length(again, int(walls.ids[1]))
    none = kept(walls, np.zeros(4, bool))
    assert (len(none), len(none.corners)) == (0, 0)


def test_a_folder_of_a_map_has_walls_that_can_be_measured(room: Room, tmp_path: Path) -> None:
    grid, walls = room
    write_map(tmp_path, grid, walls)
    again = read_walls(tmp_path)
    assert isinstance(again, JointWalls)
    one, two = (Feature("wall", id) for id in walls.ids[:2].tolist())
    assert distance(again, one, two).sigma == pytest.approx(distance(walls, one, two).sigma, rel=1e-3)
    (tmp_path / COVARIANCE_FILE).write_bytes(b"nonsense")
    with pytest.raises(MapFileError, match=rf"{COVARIANCE_FILE}: .* damaged: .* Without this file"):
        read_walls(tmp_path)
    write_map(tmp_path, grid, table(walls))  # of these it is not known
    assert not (tmp_path / COVARIANCE_FILE).exists()
    assert walls_csv(read_walls(tmp_path)) == walls_csv(walls)
    assert not isinstance(read_walls(tmp_path), JointWalls)


def repacked(change: Callable[[np.ndarray], None]) -> Callable[[bytes], bytes]:
    """The numbers of four walls, changed; after four ids of eight bytes come those of the triangle."""

    def damaged(packed: bytes) -> bytes:
        content = bytearray(zlib.decompress(packed))
        change(np.frombuffer(content, "<f4", offset=32))
        return zlib.compress(bytes(content))

    return damaged


def setting(number: int, value: float) -> Callable[[np.ndarray], None]:
    return lambda numbers: numbers.__setitem__(number, value)


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda packed: b"", "has not the"),
        (lambda packed: packed[: len(packed) // 2], "has not the"),
        (lambda packed: packed[:-1], "has not the"),
        (lambda packed: b"\0" + packed[1:], "copy it anew"),
        (lambda packed: packed[:-1] + bytes([packed[-1] ^ 1]), "copy it anew"),
        (lambda packed: zlib.compress(zlib.decompress(packed) + b"\0"), "has not the"),
        (lambda packed: zlib.compress(bytes(200_000_000)), "has not the"),
        (lambda packed: zlib.compress(b"\5" + zlib.decompress(packed)[1:]), "of other walls"),
        (repacked(setting(5, np.nan)), "no covariance has"),
        (repacked(setting(5, np.inf)), "no covariance has"),
        (repacked(setting(0, -1e-6)), "no covariance has"),
        (repacked(setting(1, 1e-2)), "positive semi-definite"),
        (repacked(setting(0, 0.0)), "positive semi-definite"),
    ],
)
def test_what_is_damaged_is_told(room: Room, damage: Callable[[bytes], bytes], said: str) -> None:
    _, walls = room
    packed = pack_covariance(walls)
    assert packed is not None
    with pytest.raises(MapFileError, match=rf"walls of this map err together is damaged: .*{said}"):
        unpack_covariance(damage(packed), table(walls))


def many(room: Room, count: int) -> JointWalls:
    """So many copies of the first wall, with ids of their own."""
    copies = table(room[1], np.zeros(count, np.int64))
    given = {name: getattr(room[1], name) for name in ("corners", "model")}
    return JointWalls(
        **{n: getattr(copies, n) for n in WallTable.__dataclass_fields__ if n != "ids"},
        **given,
        ids=np.arange(count),
    )


def test_more_walls_than_are_kept_are_not_packed_nor_read(room: Room) -> None:
    rows = room[1].model.ends_of(0)
    own = room[1].model.covariance(rows)
    assert pack_covariance(many(room, MOST_WALLS + 1)) is None
    packed = zlib.compress(b"")
    with pytest.raises(MapFileError, match=f"more than {MOST_WALLS}"):
        unpack_covariance(packed, many(room, MOST_WALLS + 1))
    count = 4 * MOST_WALLS
    full = np.tile(own, (MOST_WALLS, MOST_WALLS))  # all of them the same: as far from definite as can be
    content = np.arange(MOST_WALLS).tobytes() + full[np.tri(count, dtype=bool)].astype("<f4").tobytes()
    again = unpack_covariance(zlib.compress(content, 1), many(room, MOST_WALLS))
    pair = again.model.covariance(again.model.ends_of(0, MOST_WALLS - 1))
    np.testing.assert_allclose(pair, np.tile(own, (2, 2)), rtol=1e-6)
