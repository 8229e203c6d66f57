"""What a scan saw of another one, however many beams the sensor has."""

import numpy as np
import pytest

from lidarcore import Scan
from lidarcore.geometry import relative
from lidarcore.mapping.matching.sight import agreement, sight
from lidarcore.simulation import World

ROOM = World(np.array([[[0, 0], [6, 0]], [[6, 0], [6, 4]], [[6, 4], [0, 4]], [[0, 4], [0, 0]]], float))
HERE, THERE = np.array([2.0, 1.5, 0.3]), np.array([2.3, 1.8, 0.4])


def seen(pose: np.ndarray, beams: int, blind: slice = slice(0)) -> Scan:
    bearings = np.linspace(-np.pi, np.pi, beams, endpoint=False)
    ranges, _ = ROOM.cast(pose, bearings)
    ranges[blind] = np.nan
    return Scan(ranges, bearings)


@pytest.mark.parametrize("beams", [24, 40, 60, 360])
def test_two_scans_of_one_room_agree(beams: int) -> None:
    lies_on, nearer = agreement(
        sight(seen(HERE, beams)), sight(seen(THERE, beams)), relative(HERE, THERE), 0.1
    )
    assert lies_on > 0.9
    assert nearer < 0.05


@pytest.mark.parametrize("beams", [24, 60, 360])
def test_what_no_beam_returned_from_counts_as_neither(beams: int) -> None:
    half = slice(0, beams // 2)
    lies_on, nearer = agreement(sight(seen(HERE, beams, half)), sight(seen(HERE, beams)), np.zeros(3), 0.1)
    assert lies_on == pytest.approx(0.5, abs=0.06)
    assert nearer == 0


@pytest.mark.parametrize("beams", [2, 24, 150, 249, 250, 251, 252, 253, 254, 255, 300, 900])
@pytest.mark.parametrize("wide", [0.3, 0.5, 0.51, 0.7, 1.0])
def test_nothing_is_known_between_returns_twice_as_far_apart_as_most_beams(beams: int, wide: float) -> None:
    """As many beams lie wide apart as that, the others side by side."""
    gaps = np.where(np.arange(beams - 1) < wide * (beams - 1), 1.0, 1e-6)
    bearings = np.concatenate([[0.0], np.cumsum(gaps)]) * 6.283 / gaps.sum() - np.pi + 1e-5
    expected = max(0.1, 2 * np.median(np.diff(bearings)))
    assert sight(Scan(np.ones(beams), bearings)).apart == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("first", [-2 * np.pi, -3.0, 0.0, 1.0, np.pi, 5.0])
@pytest.mark.parametrize("turn", [np.pi, 2 * np.pi, 2 * np.pi + 1e-9])
@pytest.mark.parametrize("lost", [slice(0), slice(0, 7), slice(20, 60, 3), slice(None)])
def test_returns_come_in_the_order_of_their_bearings(first: float, turn: float, lost: slice) -> None:
    """Whichever beam the ring begins with, also where the last one lies upon the first or a little past it."""
    bearings, ranges = np.linspace(first, first + turn, 80), np.arange(1.0, 81.0)
    ranges[lost] = np.nan
    found = sight(Scan(ranges, bearings))
    kept = ~np.isnan(ranges)
    at = np.pi - (np.pi - bearings[kept]) % (2 * np.pi)
    order = np.argsort(at, kind="stable")
    np.testing.assert_array_equal(found.bearings, at[order])
    assert sorted(found.ranges) == sorted(ranges[kept])
    np.testing.assert_allclose(
        np.interp(found.ranges, np.arange(1.0, 81.0), bearings) % (2 * np.pi),
        found.bearings % (2 * np.pi),
        atol=1e-9,
    )
