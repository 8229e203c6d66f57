"""The robot's own body: masked out, and found by what stays where it is."""

import numpy as np
import pytest

from lidarcore import Scan, SensorNoise
from lidarcore.body_mask import Sector, masked, suggest_mask
from lidarcore.errors import MaskError
from lidarcore.simulation import SimulatedSensor, furnished_room, random_pose

NOISE = SensorNoise(0.01, 0.001)
POSTS = ((3.05, 0.08, 0.24), (1.2, 0.05, 0.35))  # bearing, half width (rad), range (m); one across the wrap


def scans(count: int = 60, moving: bool = True) -> list[Scan]:
    rng = np.random.default_rng(5)
    sensor, still = SimulatedSensor(furnished_room(), NOISE), random_pose(furnished_room(), rng)
    found = []
    for _ in range(count):
        scan = sensor.scan(random_pose(furnished_room(), rng) if moving else still, rng)[0]
        ranges = scan.ranges.copy()
        for bearing, half, at in POSTS:
            on = np.abs((scan.bearings - bearing + np.pi) % (2 * np.pi) - np.pi) < half
            ranges[on] = at + rng.normal(0, 0.005, on.sum())
        found.append(Scan(ranges, scan.bearings))
    return found


def on_posts(scan: Scan) -> np.ndarray:
    return np.any(
        [np.abs((scan.bearings - b + np.pi) % (2 * np.pi) - np.pi) < half for b, half, _ in POSTS], axis=0
    )


def test_near_returns_in_a_sector_go_and_all_others_stay():
    scan = Scan([0.2, 0.3, 2.0, 0.2], [-0.1, 0.1, 0.15, 1.0], beam_times=[0, 1, 2, 3], stamp=7.0)
    left = masked(scan, [Sector(-0.2, 0.2, 0.5)])
    assert left.valid.tolist() == [False, False, True, True]
    assert left.stamp == 7
    assert left.beam_times.tolist() == [0, 1, 2, 3]
    assert masked(scan, [Sector(2.0, 3.0, 0.5)]) is scan


def test_sectors_go_counter_clockwise_across_the_wrap():
    bearings = np.array([-3.1, -2.9, 0.0, 2.9, 3.1])
    assert Sector(3.0, -3.0, 1).holds(bearings).tolist() == [True, False, False, False, True]
    assert Sector(-3.0, 3.0, 1).holds(bearings).tolist() == [False, True, True, True, False]
    assert Sector(0.0, 2 * np.pi, 1).holds(bearings).all()


def test_what_stays_while_the_room_moves_is_suggested():
    seen = scans()
    sectors = suggest_mask(seen)
    assert len(sectors) == 2
    for scan in seen:
        left = masked(scan, sectors)
        assert not left.valid[on_posts(scan)].any()
        assert (left.valid == scan.valid)[~on_posts(scan)].mean() > 0.99


def test_a_room_without_a_body_needs_no_mask():
    rng = np.random.default_rng(6)
    sensor, room = SimulatedSensor(furnished_room(), NOISE), furnished_room()
    assert suggest_mask([sensor.scan(random_pose(room, rng), rng)[0] for _ in range(40)]) == ()


@pytest.mark.parametrize(("seen", "word"), [(scans(10), "few"), (scans(30, moving=False), "hardly moved")])
def test_without_motion_nothing_is_suggested(seen, word):
    with pytest.raises(MaskError, match=word):
        suggest_mask(seen)


@pytest.mark.parametrize("sector", [(0, 1, 0), (0, np.nan, 1), (np.inf, 1, 1), (0, 1, -2)])
def test_sectors_that_are_none_are_refused(sector):
    with pytest.raises(MaskError):
        Sector(*sector)
