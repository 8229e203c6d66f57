"""Means, covariances and scatters against simple formulas and against simulation with known truth."""

from dataclasses import replace

import numpy as np
import pytest
from post_scenes import Posts, scenes
from scipy.stats import binom, chi2

from lidarcore import Scan, SensorNoise
from lidarcore.clusters import CLUSTERERS, ClusterSettings, cluster

noises = pytest.mark.parametrize("noise", [SensorNoise(0.01, 0.001), SensorNoise(0.02, 0.0034)], ids=str)
EXACT = SensorNoise(1e-6, 1e-7)
TAIL = 1e-8  # of either tail of each figure: of all of them, one false alarm in a million


def normalised(error, covariance):
    """Squared error in units of its covariance; chi-square distributed if that is true."""
    return error @ np.linalg.solve(covariance, error)


@pytest.mark.parametrize("method", CLUSTERERS)
def test_means_and_scatters_are_those_of_the_members(method):
    for scan, _ in scenes(3, 5, seed=21):
        found = cluster(scan, ClusterSettings(method=method, min_points=2))
        for k in range(len(found)):
            members = scan.xy[found.labels == k]
            assert found.means[k] == pytest.approx(members.mean(axis=0), rel=1e-12)
            assert found.scatters[k] == pytest.approx(np.cov(members.T, bias=True), rel=1e-6, abs=1e-14)


def of_noise(scan, noise, settings):
    """The share of the noise in the covariance of the one cluster: what is left is where the beams fall."""
    told, not_told = (cluster(scan, replace(settings, noise=n)).covariances[0] for n in (noise, EXACT))
    return told - not_told


@noises
def test_the_share_of_the_noise_is_what_numeric_derivatives_give(noise):
    bearings = np.linspace(-0.1, 0.12, 40)
    ranges = Posts(np.array([[1.8, 0.02]]), 0.3).cast(bearings)[0]
    settings, step, total = ClusterSettings(distance=1.0), 1e-5, np.zeros((2, 2))
    for unit in np.eye(40):
        for dr, db, sigma in ((unit, 0, noise.sigma_range), (0, unit, noise.sigma_bearing)):
            ahead, behind = (
                cluster(Scan(ranges + h * dr, bearings + h * db), settings).means[0] for h in (step, -step)
            )
            total += sigma**2 * np.outer(*2 * [(ahead - behind) / (2 * step)])
    assert of_noise(Scan(ranges, bearings), noise, settings) == pytest.approx(total, rel=1e-6)


@pytest.mark.long
@noises
@pytest.mark.parametrize("radius", [0.1, 0.3])
def test_the_share_of_the_noise_holds_the_mean_as_often_as_it_says(noise, radius):
    rng, trials = np.random.default_rng(22), 1500
    post = Posts(np.array([[1.8, 1.2]]), radius)
    bearings = np.linspace(-np.pi, np.pi, 2000, endpoint=False)
    bearings = bearings[~np.isnan(post.cast(bearings)[0])]
    settings = ClusterSettings(distance=1.0)
    truth = cluster(Scan(post.cast(bearings)[0], bearings), settings).means[0]
    held = 0
    for _ in range(trials):
        scan, _ = post.scan(bearings, rng, noise)
        error = cluster(scan, settings).means[0] - truth
        held += normalised(error, of_noise(scan, noise, settings)) <= chi2.ppf(0.95, 2)
    assert binom.ppf(TAIL, trials, 0.95) <= held <= binom.ppf(1 - TAIL, trials, 0.95)


@pytest.mark.parametrize("spacing", [0.005, 0.02])
def test_a_flat_object_of_any_width_is_where_it_is_within_the_spacing_of_the_beams(spacing):
    rng, trials = np.random.default_rng(23), 1000
    ratios = []
    for _ in range(trials):
        y = spacing * (np.arange(-200, 201) + rng.uniform())
        y = y[np.abs(y) < rng.uniform(5, 30) * spacing]
        scan = Scan(np.hypot(2.0, y), np.arctan2(y, 2.0))
        found = cluster(scan, ClusterSettings(noise=EXACT))
        ratios.append(found.means[0, 1] ** 2 / found.covariances[0, 1, 1])
    ratios = np.array(ratios)
    assert abs(ratios.mean() - 1) < 4 * ratios.std() / np.sqrt(trials)
    assert found.covariances[0, 1, 1] == pytest.approx(spacing**2 / 24, rel=1e-3)


@pytest.mark.long
@noises
def test_the_mean_of_a_post_met_by_other_beams_in_every_scan_is_where_its_covariance_says(noise):
    """Noise alone would claim too much: it holds the mean far less often."""
    rng, trials = np.random.default_rng(24), 1000
    held, held_by_noise = 0, 0
    settings = ClusterSettings(noise=noise, distance=1.0)
    for _ in range(trials):
        post = Posts(np.array([[rng.uniform(1.5, 3), 0.0]]), rng.uniform(0.1, 0.3))
        every = np.linspace(-0.3, 0.3, 6001)
        truth = cluster(Scan(post.cast(every)[0], every), settings).means[0]
        scan, _ = post.scan((np.arange(-50, 50) + rng.uniform()) * 2 * np.pi / 926, rng, noise)
        found = cluster(scan, settings)
        error = found.means[0] - truth
        held += normalised(error, found.covariances[0]) <= chi2.ppf(0.95, 2)
        held_by_noise += normalised(error, of_noise(scan, noise, settings)) <= chi2.ppf(0.95, 2)
    assert held_by_noise < binom.ppf(TAIL, trials, 0.95) <= held


@pytest.mark.parametrize("radius", [0.05, 0.2])
def test_the_mean_of_a_post_is_in_front_of_its_centre(radius):
    scan, _ = Posts(np.array([[6.0, 0.0]]), radius).scan(
        np.linspace(-0.1, 0.1, 20_001), np.random.default_rng(25), EXACT
    )
    assert 6.0 - cluster(scan).means[0, 0] == pytest.approx(np.pi * radius / 4, rel=0.05)
