"""Noiseless walls come back exactly, and fits follow when walls are turned, shuffled or scaled."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from law_walls import (
    EPS,
    ROOM_WALLS,
    Wall,
    angle_between,
    assert_positive_definite,
    measured_walls,
    noises,
    relative,
    walls,
)

from lidarcore import FITTERS, SensorNoise

every_fitter = pytest.mark.parametrize("name", FITTERS)
ROUNDING = 100 * EPS  # a few dozen roundings, carried on by the conditioning of the wall
# A fit to noisy points, iterated or not, repeats to this share of its own standard deviations.
REPEATABLE = 1e-6


def assert_same_line(found, expected, turn=0.0, scale=1.0):
    """A fit that should be `expected` turned and scaled, in units of its standard deviations."""
    S = np.diag([1.0, scale])
    for kind in ("covariance_published", "covariance_consistent"):
        assert relative(getattr(found, kind), S @ getattr(expected, kind) @ S) < 1e-6
    sigma = np.sqrt(np.diag(expected.covariance_consistent))
    assert abs(angle_between(found.alpha, expected.alpha + turn)) < REPEATABLE * sigma[0]
    assert abs(found.r - scale * expected.r) < REPEATABLE * sigma[1] * scale


@every_fitter
@given(wall=walls(), noise=noises)
def test_a_noiseless_wall_is_recovered_exactly(name, wall, noise):
    line = FITTERS[name].fit(wall.ranges, wall.bearings, noise)
    assert abs(angle_between(line.alpha, wall.alpha)) < ROUNDING * wall.conditioning
    assert abs(line.r - wall.r) < ROUNDING * wall.conditioning * wall.ranges.max()
    assert -np.pi < line.alpha <= np.pi
    assert line.r >= 0
    assert_positive_definite(line.covariance_published)
    assert_positive_definite(line.covariance_consistent)


@every_fitter
@pytest.mark.parametrize("r", [0.05, 0.3, 1.0, 5.0, 40.0, 1000.0])
@pytest.mark.parametrize("quarter", range(-7, 9))
def test_a_wall_is_recovered_on_every_side_of_the_sensor(name, r, quarter):
    wall = Wall(quarter * np.pi / 8, r, np.linspace(-0.7, 0.4, 23))
    line = FITTERS[name].fit(wall.ranges, wall.bearings, SensorNoise())
    assert angle_between(line.alpha, wall.alpha) == pytest.approx(0, abs=1e-12)
    assert line.r == pytest.approx(r, rel=1e-12)


@pytest.mark.parametrize("name", [name for name in FITTERS if name != "cwlf"])
@given(measured=measured_walls(), turn=st.floats(-np.pi, np.pi))
def test_fits_turn_with_the_wall(name, measured, turn):
    _, ranges, bearings, noise = measured
    fit = FITTERS[name].fit
    assert_same_line(fit(ranges, bearings + turn, noise), fit(ranges, bearings, noise), turn)


@given(measured=measured_walls(), quarters=st.integers(-2, 2))
def test_cwlf_turns_by_quarters(measured, quarters):
    _, ranges, bearings, noise = measured
    x, y = ranges * np.cos(bearings), ranges * np.sin(bearings)
    assume(abs(np.log(np.var(x) / np.var(y))) > 1e-6)  # at 45 degrees either axis is right
    turn = quarters * np.pi / 2
    fit = FITTERS["cwlf"].fit
    assert_same_line(fit(ranges, bearings + turn, noise), fit(ranges, bearings, noise), turn)


def test_cwlf_does_not_turn_elsewhere():
    """How far it is off, against what noise does: its regression along an axis leans towards that axis."""
    noise, rng = SensorNoise(0.05, 0.0035), np.random.default_rng(5)
    off, spread = [], []
    for wall in ROOM_WALLS:
        ranges, bearings = wall.measured(noise, rng)
        turns = np.linspace(0, np.pi / 2, 91)
        lines = [FITTERS["cwlf"].fit(ranges, bearings + turn, noise) for turn in turns]
        sigma = np.sqrt(lines[0].covariance_consistent[0, 0])
        off.append(
            np.ptp(
                [
                    angle_between(line.alpha, turn + wall.alpha)
                    for line, turn in zip(lines, turns, strict=True)
                ]
            )
            / sigma
        )
        published = [line.covariance_published[0, 0] for line in lines]
        spread.append(max(published) / min(published))
    print("alpha off by", np.round(off, 2), "sigma; published variances differ by", np.round(spread, 2))
    assert min(off) > 0.1
    assert max(spread) > 2


@every_fitter
@given(measured=measured_walls(), seed=st.integers(0, 2**32 - 1))
def test_the_order_of_points_does_not_matter(name, measured, seed):
    _, ranges, bearings, noise = measured
    order = np.random.default_rng(seed).permutation(len(ranges))
    fit = FITTERS[name].fit
    assert_same_line(fit(ranges[order], bearings[order], noise), fit(ranges, bearings, noise))


@every_fitter
@given(measured=measured_walls(), share=st.floats(0.001, 1))
def test_lengths_scale(name, measured, share):
    _, ranges, bearings, noise = measured
    scale = share * min(20.0, 1 / noise.sigma_range)
    scaled = SensorNoise(noise.sigma_range * scale, noise.sigma_bearing)
    fit = FITTERS[name].fit
    assert_same_line(fit(scale * ranges, bearings, scaled), fit(ranges, bearings, noise), scale=scale)
