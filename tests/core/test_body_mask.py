"""The robot's own body: masked out, and found by what stays where it is."""

import numpy as np
import pytest
from robot_body import drive, on_posts

from lidarcore import Scan, SensorNoise
from lidarcore.body_mask import MOST_SECTORS, Sector, as_text, from_text, masked, suggest_mask
from lidarcore.errors import MaskError
from lidarcore.simulation import SimulatedSensor, furnished_room, random_pose


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
    seen = drive()
    sectors = suggest_mask(seen)
    assert len(sectors) == 2
    for scan in seen:
        left = masked(scan, sectors)
        assert not left.valid[on_posts(scan)].any()
        assert (left.valid == scan.valid)[~on_posts(scan)].mean() > 0.99


def test_a_room_without_a_body_needs_no_mask():
    rng = np.random.default_rng(6)
    sensor, room = SimulatedSensor(furnished_room(), SensorNoise(0.01, 0.001)), furnished_room()
    assert suggest_mask([sensor.scan(random_pose(room, rng), rng)[0] for _ in range(40)]) == ()


@pytest.mark.parametrize(("seen", "word"), [(drive(10), "few"), (drive(30, moving=False), "hardly moved")])
def test_without_motion_nothing_is_suggested(seen, word):
    with pytest.raises(MaskError, match=word):
        suggest_mask(seen)


@pytest.mark.parametrize("sector", [(0, 1, 0), (0, np.nan, 1), (np.inf, 1, 1), (0, 1, -2), (0, 7, 1)])
def test_sectors_that_are_none_are_refused(sector):
    with pytest.raises(ValueError, match="Sector"):
        Sector(*sector)


def test_a_mask_as_text_is_the_same_mask():
    mask = (Sector(2.0, -2.5, 1 / 3), Sector(0.1, 0.2, 0.3))
    assert from_text(as_text(mask)) == mask
    assert from_text(as_text(())) == ()


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "[1]",
        '[{"first": 0, "last": 1}]',
        '[{"first": 0, "last": NaN, "reach": 1}]',
        as_text([Sector(0, 1, 1)] * (MOST_SECTORS + 1)),
        "[" + " " * 100_000 + "]",
    ],
)
def test_a_text_that_is_no_mask_is_refused(text):
    with pytest.raises(MaskError, match="mask"):
        from_text(text)
