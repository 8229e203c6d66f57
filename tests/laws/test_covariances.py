"""Covariances against the fitters themselves: numeric Jacobians, Monte Carlo, the Cramér-Rao bound."""

import numpy as np
import pytest
from hypothesis import given
from law_walls import ROOM_WALLS, angle_between, noises, relative, walls
from scipy.stats import chi2

from lidarcore import FITTERS, SensorNoise

every_fitter = pytest.mark.parametrize("name", FITTERS)
each_wall = pytest.mark.parametrize("wall", ROOM_WALLS, ids=range(len(ROOM_WALLS)))
LOW = SensorNoise(0.005, 0.0005)  # first order holds: errors of a few millimetres over walls of metres
TRIALS = 4000
# 6 fitters x 5 walls x 4 figures and their lower and upper tails, one false alarm in a million for all together. The
# band is 0.88 to 1.13 of the claimed variance even so: one that is wrong by a quarter is surely caught.
TAIL = 1e-6 / (6 * 5 * 4 * 2)


def numeric_covariance(fit, ranges, bearings, noise):
    """First-order covariance of fit(ranges, bearings) -> (alpha, r), by central differences of fourth order.

    Steps are small against the noise, too: where a beam is moved by several of its sigmas, the search of ml does not
    always come to an end, and a derivative says nothing that far off.
    """
    total = np.zeros((2, 2))
    for values, sigma, step in (
        (ranges, noise.sigma_range, min(1e-5 * ranges.min(), 0.02 * noise.sigma_range)),
        (bearings, noise.sigma_bearing, 1e-5),
    ):
        for i in range(len(values)):
            derivative = np.zeros(2)
            for moved, weight in ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12)):
                changed = values.copy()
                changed[i] += moved * step
                pair = (changed, bearings) if values is ranges else (ranges, changed)
                derivative += weight * fit(*pair) / step
            total += sigma**2 * np.outer(derivative, derivative)
    return total


def estimator(name, noise, about):
    """Without latent bearings: to first order they change nothing, but differences would show their curvature."""

    def fit(ranges, bearings):
        line = FITTERS[name].fit(ranges, bearings, noise, latent_bearings=False)
        return np.array([about + angle_between(line.alpha, about), line.r])

    return fit


def cramer_rao(wall, noise):
    """Bound for (alpha, r): inverse Fisher information of all measurements, true bearings unknown.

    Parameters are each beam's true bearing, alpha and r; means are r / cos(bearing - alpha) and the bearing;
    derivatives by complex steps. The triangular factor of the whitened Jacobian is the root of the information,
    its last corner that of (alpha, r) with the bearings eliminated.
    """
    n = len(wall.incidence)
    parameters = np.concatenate([wall.bearings, [wall.alpha, wall.r]]).astype(complex)
    J = np.empty((2 * n, n + 2))
    for k in range(n + 2):
        moved = parameters.copy()
        moved[k] += 1e-100j
        J[:, k] = np.imag(np.concatenate([moved[-1] / np.cos(moved[:-2] - moved[-2]), moved[:-2]])) / 1e-100
    root = np.linalg.inv(
        np.linalg.qr(J / np.repeat([noise.sigma_range, noise.sigma_bearing], n)[:, None], "r")[-2:, -2:]
    )
    return root @ root.T


def excess(covariance, bound):
    """Eigenvalues of a covariance in units of the bound: 1 is the bound, less is impossible."""
    L = np.linalg.inv(np.linalg.cholesky(bound))
    return np.linalg.eigvalsh(L @ covariance @ L.T)


@every_fitter
@each_wall
def test_consistent_covariance_is_the_numeric_jacobian_on_noiseless_points(name, wall):
    noise = SensorNoise(0.02, 0.003)
    line = FITTERS[name].fit(wall.ranges, wall.bearings, noise)
    numeric = numeric_covariance(estimator(name, noise, wall.alpha), wall.ranges, wall.bearings, noise)
    assert relative(line.covariance_consistent, numeric) < 1e-6


@every_fitter
@given(wall=walls(0.2, 30, least_points=3), noise=noises)
def test_consistent_covariance_is_the_numeric_jacobian_of_any_wall(name, wall, noise):
    line = FITTERS[name].fit(wall.ranges, wall.bearings, noise)
    ranges, bearings = np.array(wall.ranges), np.array(wall.bearings)
    numeric = numeric_covariance(estimator(name, noise, wall.alpha), ranges, bearings, noise)
    rounding = 1e-9 * wall.conditioning  # of the differences: 100 EPS over a step of 1e-5
    assert relative(line.covariance_consistent, numeric) < 1e-6 + rounding


@pytest.mark.parametrize("name", ["utls", "wtls"])
@each_wall
def test_published_covariance_of_the_implicit_fitters_is_exact_also_on_noisy_points(name, wall):
    noise = SensorNoise(0.03, 0.003)
    ranges, bearings = wall.measured(noise, np.random.default_rng(1))
    line = FITTERS[name].fit(ranges, bearings, noise)
    numeric = numeric_covariance(estimator(name, noise, wall.alpha), ranges, bearings, noise)
    assert relative(line.covariance_published, numeric) < 1e-6


@every_fitter
@each_wall
def test_errors_scatter_as_the_consistent_covariance_says(name, wall):
    """Sample variances along both axes of the claimed ellipse, about the mean and about the truth: chi-squares."""
    rng = np.random.default_rng(20240)
    fit = estimator(name, LOW, wall.alpha)
    errors = np.array([fit(*wall.measured(LOW, rng)) for _ in range(TRIALS)]) - [wall.alpha, wall.r]
    claimed = FITTERS[name].fit(wall.ranges, wall.bearings, LOW).covariance_consistent
    white = np.linalg.solve(np.linalg.cholesky(claimed), errors.T)
    low, high = chi2.ppf([TAIL, 1 - TAIL], TRIALS - 1)
    scatter = ((white - white.mean(1, keepdims=True)) ** 2).sum(1)
    assert (low < scatter).all()
    assert (scatter < high).all()
    # Uncorrelated after whitening: n times the squared correlation is a chi-square of one degree of freedom.
    assert TRIALS * np.corrcoef(white)[0, 1] ** 2 < chi2.ppf(1 - TAIL, 1)
    # No bias to speak of at low noise: about the truth both together are a chi-square of 2 n.
    assert (white**2).sum() < chi2.ppf(1 - TAIL, 2 * TRIALS)


@every_fitter
@given(wall=walls(), noise=noises)
def test_no_consistent_covariance_claims_more_than_the_cramer_rao_bound(name, wall, noise):
    line = FITTERS[name].fit(wall.ranges, wall.bearings, noise)
    share = excess(line.covariance_consistent, cramer_rao(wall, noise))
    rounding = 1e-13 * wall.conditioning**2
    assert share[0] > 1 - 1e-9 - rounding
    if name == "ml":
        assert share[1] < 1 + 1e-9 + rounding


@each_wall
def test_maximum_likelihood_reaches_the_cramer_rao_bound_at_low_noise(wall):
    rng, fit = np.random.default_rng(77), estimator("ml", LOW, wall.alpha)
    errors = np.array([fit(*wall.measured(LOW, rng)) for _ in range(TRIALS)]) - [wall.alpha, wall.r]
    squares = np.einsum("ti,ij,tj->", errors, np.linalg.inv(cramer_rao(wall, LOW)), errors)
    low, high = chi2.ppf([TAIL, 1 - TAIL], 2 * TRIALS)
    assert low < squares < high


@pytest.mark.parametrize("name", ["cwlf", "wctls"])
@given(wall=walls(), noise=noises)
def test_conditional_variances_claim_less_than_any_estimator_can_reach(name, wall, noise):
    """The published covariances of cwlf and wctls lie below the Cramér-Rao bound, whatever the wall."""
    line = FITTERS[name].fit(wall.ranges, wall.bearings, noise)
    share = excess(line.covariance_published, cramer_rao(wall, noise))
    assert share[1] < 1 + 1e-9 + 1e-13 * wall.conditioning**2


def room_corner(noise, rng, name):
    """Estimate of the corner (2.6, 1.4) of a 4.5 x 2.5 m room from both its walls, and two covariances of it."""
    corner, lines = np.array([2.6, 1.4]), []
    for alpha, r, ends in ((0.0, 2.6, (-1.1, 1.4)), (np.pi / 2, 1.4, (-1.9, 2.6))):
        angles = np.sort(np.arctan2(ends, r) * (1 if alpha == 0 else -1))
        incidence = np.arange(angles[0], angles[1], np.radians(0.391))
        bearings = alpha + incidence + rng.normal(0, noise.sigma_bearing, len(incidence))
        ranges = r / np.cos(incidence) + rng.normal(0, noise.sigma_range, len(incidence))
        lines.append(FITTERS[name].fit(ranges, bearings, noise))
    N = np.array([line.normal for line in lines])
    T = N[:, ::-1] * [-1, 1]
    found = np.linalg.solve(N, [line.r for line in lines])
    result = [found - corner]
    for kind in ("covariance_published", "covariance_consistent"):
        across = [
            np.array([-(t @ found), 1.0]) @ getattr(line, kind) @ [-(t @ found), 1.0]
            for t, line in zip(T, lines, strict=True)
        ]
        inverse = np.linalg.inv(N)
        result.append(inverse @ np.diag(across) @ inverse.T)
    return result


@pytest.mark.parametrize(
    ("name", "kind", "least", "most"),
    [
        ("cwlf", "published", 0.0, 0.5),
        ("wctls", "published", 0.0, 0.5),
        ("ml", "published", 0.92, 0.98),
        ("ml", "consistent", 0.92, 0.98),
        ("utls", "published", 0.92, 0.98),
        ("wctls", "consistent", 0.9, 0.98),
    ],
)
def test_ellipses_hold_the_true_corner_as_often_as_they_say(name, kind, least, most):
    """Coverage of 95 % ellipses in the papers' small room with the noise of an RPLIDAR S1."""
    noise, rng, trials = SensorNoise(0.05, np.radians(0.2)), np.random.default_rng(9), 1500
    held = 0
    for _ in range(trials):
        error, *covariances = room_corner(noise, rng, name)
        held += error @ np.linalg.solve(covariances[kind == "consistent"], error) < chi2.ppf(0.95, 2)
    print(name, kind, held / trials)
    assert least <= held / trials <= most
