import numpy as np
import pytest
from posts import find_posts, fit_circle
from scipy.stats import binom, chi2

from lidarcore import Scan, SensorNoise
from lidarcore.scan import Array

NOISE = SensorNoise(0.01, 0.001)
BEARINGS = np.linspace(-np.pi, np.pi, 900, endpoint=False)
WALL = 6.0


def scan_of(centres: Array, radius: float, rng: np.random.Generator) -> Scan:
    """Posts in front of a round wall, with the noise of the sensor."""
    true = BEARINGS + rng.normal(0, NOISE.sigma_bearing, 900)
    u = np.stack([np.cos(true), np.sin(true)], -1)
    along, across = u @ centres.T, np.stack([-u[:, 1], u[:, 0]], -1) @ centres.T
    with np.errstate(invalid="ignore"):
        met = np.where((along > 0) & (np.abs(across) < radius), along - np.sqrt(radius**2 - across**2), WALL)
    return Scan(met.min(axis=1) + rng.normal(0, NOISE.sigma_range, 900), BEARINGS)


def test_posts_are_found_where_they_stand_and_nothing_else_is() -> None:
    centres = np.array([[1.5, 0.4], [-1.0, 2.0], [0.3, -2.2], [-2.4, 0.1]])
    found = find_posts(scan_of(centres, 0.1, np.random.default_rng(0)), 0.1, NOISE)
    distance = np.linalg.norm(found.xy[:, None] - centres, axis=-1)
    assert sorted(distance.argmin(axis=1)) == [0, 1, 2, 3]
    assert distance.min(axis=1).max() < 0.03


def test_what_is_wider_than_the_post_is_none() -> None:
    found = find_posts(scan_of(np.array([[1.5, 0.4]]), 0.3, np.random.default_rng(0)), 0.1, NOISE)
    assert len(found) == 0


@pytest.mark.parametrize("centre", [[1.2, 0.0], [1.0, 1.5]])
def test_the_ellipse_of_a_post_holds_its_centre_as_often_as_it_says(centre: list[float]) -> None:
    """95 % ellipses over 600 trials, within what the binomial law allows."""
    rng, trials, radius, inside = np.random.default_rng(1), 600, 0.1, 0
    truth = np.array(centre)
    middle, half = np.arctan2(truth[1], truth[0]), 0.9 * np.arcsin(radius / np.hypot(*truth))
    measured = BEARINGS[np.abs(BEARINGS - middle) < half]
    for _ in range(trials):
        true = measured + rng.normal(0, NOISE.sigma_bearing, len(measured))
        along, across = (truth @ np.stack(axes) for axes in _axes(true))
        ranges = along - np.sqrt(radius**2 - across**2) + rng.normal(0, NOISE.sigma_range, len(measured))
        fit = fit_circle(ranges, measured, radius, NOISE)
        assert fit is not None
        error = fit[0] - truth
        inside += error @ np.linalg.solve(fit[1], error) < chi2.ppf(0.95, 2)
    low, high = binom.ppf([0.001, 0.999], trials, 0.95)
    assert low <= inside <= high, inside / trials


def _axes(bearings: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    c, s = np.cos(bearings), np.sin(bearings)
    return (c, s), (-s, c)
