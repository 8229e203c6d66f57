"""Patches of a scan against surfaces that are known."""

import numpy as np
import pytest

from lidarcore import Scan, SensorNoise
from lidarcore.mapping.matching.patches import Patches, joined, patches
from lidarcore.mapping.settings import MatchSettings

NEAR, FAR = 2.0, 2.4  # m ahead
MATCH = MatchSettings(noise=SensorNoise(0.005, 0.001))
EVERYWHERE_ALIKE = SensorNoise(0.01, 1e-6)


def scan_of_a_board_before_a_wall(beams: int, between: float) -> Scan:
    """Beams to a board 1 m wide; the first one beyond either edge reports a range this share of the way to the wall."""
    bearings = np.linspace(-0.6, 0.6, beams)
    board = np.abs(NEAR * np.tan(bearings)) < 0.5
    ahead = np.where(board, NEAR, FAR)
    first, last = np.flatnonzero(board)[[0, -1]]
    ahead[[first - 1, last + 1]] = NEAR + between * (FAR - NEAR)
    return Scan(ahead / np.cos(bearings), bearings)


@pytest.mark.parametrize("degrees", range(0, 360, 15))
def test_normals_look_at_the_sensor_from_a_wall_on_any_side(degrees: int) -> None:
    bearings = np.linspace(-0.5, 0.5, 120)
    seen = patches(Scan(NEAR / np.cos(bearings), bearings + np.deg2rad(degrees)), MATCH)
    outwards = np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))])
    assert len(seen.normals) > 10
    np.testing.assert_allclose(seen.normals @ outwards, -1, atol=1e-12)


@pytest.mark.parametrize("between", [0.05, 0.15, 0.5, 0.9])
def test_beams_that_meet_both_sides_of_an_edge_move_no_patch(between: float) -> None:
    seen = patches(scan_of_a_board_before_a_wall(180, between), MATCH)
    ahead = seen.means[:, 0]
    assert (np.abs(ahead - NEAR) < 1e-6).sum() >= 8
    assert (np.abs(ahead - FAR) < 1e-6).sum() >= 4
    np.testing.assert_allclose(np.minimum(np.abs(ahead - NEAR), np.abs(ahead - FAR)), 0, atol=1e-6)


def test_of_beams_that_lie_far_apart_none_is_left_out() -> None:
    seen = patches(scan_of_a_board_before_a_wall(70, 1.0), MATCH)
    assert seen.counts.sum() >= 68 - 4


def test_where_every_beam_lies_beside_a_step_there_are_no_patches() -> None:
    bearings = np.linspace(-0.6, 0.6, 180)
    assert len(patches(Scan(np.where(np.arange(180) % 2, 2.0, 3.0), bearings), MATCH).means) == 0


def test_walls_seen_at_a_slant_are_patches_as_far_as_beams_show_them_straight() -> None:
    """A corridor 2.8 m wide: beside the sensor returns lie near each other, 6 m ahead every metre."""
    bearings = np.deg2rad(np.arange(-90.0, 91.0))
    with np.errstate(divide="ignore"):
        ranges = np.minimum(1.4 / np.abs(np.sin(bearings)), 30.0 / np.cos(bearings))
    seen = patches(Scan(ranges, bearings), MATCH)
    side = np.abs(seen.normals[:, 1]) > 0.99
    slanted = seen.counts == 0
    np.testing.assert_allclose(np.abs(seen.means[side, 1]), 1.4, atol=1e-9)
    assert (slanted & side & (seen.means[:, 0] > 6)).sum() >= 8
    assert np.array_equal(seen.near.means, seen.means[~slanted])
    assert seen.near.means[side[~slanted], 0].max() < 6


def patches_of_a_wall(
    beams: int,
    scatter: float,
    rng: np.random.Generator,
    away: float = 3.0,
    noise: SensorNoise = EVERYWHERE_ALIKE,
) -> Patches:
    """A wall 3 m ahead, or so far, whose returns scatter by so many m along their beams."""
    bearings = np.linspace(-0.4, 0.4, beams)
    ranges = away / np.cos(bearings) + rng.normal(0, scatter, beams)
    return patches(Scan(ranges, bearings), MatchSettings(noise=noise, unevenness=0.0))


def test_far_walls_are_known_less_where_the_noise_grows_with_the_range() -> None:
    """At 8 m it is 20 mm, where 10 are told for ranges nearby: too little for the scatter of a few returns to show."""
    rng, noise = np.random.default_rng(2), SensorNoise(0.01, 1e-6, range_growth=np.sqrt(0.0003) / 64)
    seen = joined([patches_of_a_wall(25, 0.02, rng, 8.0, noise) for _ in range(400)])
    ahead = np.abs(seen.means[:, 1]) < 1.5
    squares = (seen.means[ahead, 0] - 8.0) ** 2 / seen.variances[ahead]
    assert abs(squares.mean() - 1) < 4 * np.sqrt(2 / len(squares))


@pytest.mark.parametrize("beams", [25, 100, 400])
def test_patches_of_a_flat_wall_are_as_far_off_as_noise_makes_them(beams: int) -> None:
    """Those of few returns, too, whose own scatter tells little of it."""
    rng = np.random.default_rng(1)
    seen = joined([patches_of_a_wall(beams, 0.01, rng) for _ in range(200)])
    squares = (seen.means[:, 0] - 3.0) ** 2 / seen.variances
    assert abs(squares.mean() - 1) < 4 * np.sqrt(2 / len(squares))


def test_returns_of_a_rough_surface_are_as_far_off_as_they_scatter() -> None:
    rng = np.random.default_rng(1)
    seen = joined([patches_of_a_wall(400, 0.02, rng) for _ in range(200)])
    assert abs(np.sqrt(np.median(seen.variances * seen.counts)) - 0.02) < 0.001


def test_three_returns_that_lie_on_no_line_make_no_patch() -> None:
    bearings = np.deg2rad(np.arange(-90.0, 91.0))
    ranges = np.where(np.arange(181) % 2, 6.0, 7.0)  # pillars, each met by a single beam
    assert len(patches(Scan(ranges, bearings), MATCH).means) == 0
