"""SLAM on the scans of a simulated robot with odometry: its ellipses hold the true pose as often as they say."""

from itertools import islice

import numpy as np
import pytest
from scipy.stats import binom, chi2

from lidarcore import extract
from lidarcore.geometry import compose, inverse, wrap
from lidarcore.localization import NavigationSettings, Navigator
from lidarcore.scan import Array
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

SEEDS, COUNT = range(1, 5), 300
SETTLED = 10  # scans after which the first landmarks are confirmed
RARE = 1e-3  # a bound that an honest filter meets but once in a thousand choices of the seeds


def drive(seed: int) -> tuple[Array, Array, Array]:
    """Of each scan, the squared Mahalanobis distance of the pose from the truth, and the errors (m) of the estimate and
    of odometry alone."""
    navigator, rows = Navigator(NavigationSettings(mode="slam")), []
    for scan in islice(SimulatedRobot(SimulationSettings(world="two rooms", seed=seed)), COUNT):
        straight = navigator.deskewed(scan)
        found = navigator.step(straight, extract(straight)).estimate
        if not rows:  # the map begins where the sensor is first
            T_map_world, T_map_odom = (
                compose(found.pose, inverse(pose)) for pose in (scan.truth, scan.odometry)
            )
        truth = compose(T_map_world, scan.truth)
        error, reckoned = found.pose - truth, compose(T_map_odom, scan.odometry) - truth
        error[2] = wrap(error[2])
        covariance = found.covariance + 1e-12 * np.eye(3)  # the first pose is exact
        squared = error @ np.linalg.solve(covariance, error)
        rows.append((squared, np.hypot(*error[:2]), np.hypot(*reckoned[:2])))
    squared, slam, odometry = np.array(rows)[SETTLED:].T
    return squared, slam, odometry


@pytest.fixture(scope="module")
def runs() -> tuple[Array, Array, Array]:
    """The same of all runs, each (R, T)."""
    squared, slam, odometry = map(np.array, zip(*map(drive, SEEDS), strict=True))
    return squared, slam, odometry


def worth(series: Array) -> int:
    """How many independent draws these (R, T) are worth: errors of a map stay in all scans that are matched with it.

    All of them over the integrated autocorrelation time, by Geyer's initial positive sequence (1992): the sums of
    neighbouring autocorrelations, up to the first that is not positive. No fewer than there are runs.
    """
    runs, length = series.shape
    off = series - series.mean()
    lags = [np.mean(off[:, : length - lag] * off[:, lag:]) for lag in range(length // 2)]
    sums = np.reshape(lags[: len(lags) // 2 * 2], (-1, 2)).sum(axis=1) / lags[0]
    positive = sums[: np.argmax(sums <= 0)] if (sums <= 0).any() else sums
    return max(runs, int(series.size / (2 * positive.sum() - 1)))


def test_correlated_draws_are_worth_as_many_as_theory_says() -> None:
    """Of a first-order autoregression: (1 - a) / (1 + a) of them."""
    rng = np.random.default_rng(0)
    for a in (0.0, 0.8, 0.95):
        series = np.zeros((100, 1000))
        for k in range(1, 1000):
            series[:, k] = a * series[:, k - 1] + rng.normal(size=100)
        assert worth(series) == pytest.approx(series.size * (1 - a) / (1 + a), rel=0.15)


@pytest.mark.long
def test_no_more_poses_are_outside_of_their_ellipsoids_than_chance_puts_there(
    runs: tuple[Array, Array, Array],
) -> None:
    squared, *_ = runs
    draws = worth(squared)
    outside = float(np.mean(squared > chi2.ppf(0.99, 3)))
    assert outside <= binom.isf(RARE, draws, 0.01) / draws, f"{outside:.1%} of what is worth {draws} draws"
    assert squared.mean() <= chi2.isf(RARE, 3 * draws) / draws


@pytest.mark.long
def test_the_ellipsoids_are_no_larger_than_the_noise_that_was_told_makes_them(
    runs: tuple[Array, Array, Array],
) -> None:
    """Twice the noise of the simulated sensor is told: a quarter of the squares, or less by the accelerations."""
    squared, *_ = runs
    assert squared.mean() / 3 > 0.25 / 2


def test_the_map_takes_away_what_odometry_drifts(runs: tuple[Array, Array, Array]) -> None:
    _, slam, odometry = runs
    rms, drift = (float(np.sqrt(np.mean(np.square(errors)))) for errors in (slam, odometry))
    assert drift > 0.1
    assert rms < 0.15 * drift
    assert rms < 3 * SimulationSettings().noise.sigma_range
