"""The bound against a Fisher information that is differentiated numerically, in other parameters."""

import numpy as np
import pytest

from lidarcore import FITTERS, SensorNoise
from lidarcore.evaluation.consistency.cramer_rao import bounded_line, corner_bound
from lidarcore.lines import LINE_FIELDS
from lidarcore.tables import LINE_CONSISTENT

NOISES = [SensorNoise(0.05, np.radians(0.2)), SensorNoise(0.01, 0.001), SensorNoise(0.002, 0.02)]


def information(means, parameters, sigmas):
    """Fisher information of independent Gaussians with these means, derivatives by complex steps."""
    columns = []
    for k in range(len(parameters)):
        moved = np.array(parameters, complex)
        moved[k] += 1e-100j
        columns.append(means(moved).imag / 1e-100)
    J = np.array(columns).T / np.array(sigmas)[:, None]
    return J.T @ J


def bound_of_first_two(fisher):
    """Inverse of the information about the first two parameters, the others unknown: Schur's complement."""
    A, B, D = fisher[:2, :2], fisher[:2, 2:], fisher[2:, 2:]
    return np.linalg.inv(A - B @ np.linalg.solve(D, B.T))


def relative(found, expected):
    sigma = np.sqrt(np.diag(expected))
    return np.abs((found - expected) / np.outer(sigma, sigma)).max()


def line_bound(alpha, r, bearings, noise):
    row = np.empty(LINE_FIELDS)
    bounded_line(bearings, np.cos(alpha), np.sin(alpha), r, noise.sigma_range**2, noise.sigma_bearing**2, row)
    return row[LINE_CONSISTENT : LINE_CONSISTENT + 4].reshape(2, 2)


CORNERS = [  # x, y, directions of the two walls from the corner, how far each is seen, increment of bearing
    (2.1, 1.3, np.radians(180), np.radians(-90), 3.5, 2.2, np.radians(0.39)),
    (-4.0, 2.0, np.radians(-10), np.radians(-80), 5.0, 1.0, np.radians(0.39)),
    (0.5, -6.0, np.radians(60), np.radians(170), 2.0, 4.0, np.radians(1.0)),
]


def beams_on(corner, direction, length, increment):
    """True bearings of the beams that meet the wall from the corner on."""
    ends = [corner, corner + length * np.array([np.cos(direction), np.sin(direction)])]
    a, b = (np.arctan2(y, x) for x, y in ends)
    b = a + np.angle(np.exp(1j * (b - a)))
    return np.arange(min(a, b) + increment / 3, max(a, b), increment)


def normal_form(corner, direction):
    alpha = direction + np.pi / 2
    r = corner @ [np.cos(alpha), np.sin(alpha)]
    return (alpha, r) if r > 0 else (alpha + np.pi, -r)


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("case", CORNERS)
def test_bound_of_a_corner_is_the_inverse_of_the_numeric_fisher_information(case, noise):
    """Parameters here: the corner, the directions of both walls, and every beam's true bearing."""
    x, y, first, second, *lengths, increment = case
    corner = np.array([x, y])
    bearings = [
        beams_on(corner, direction, length, increment)
        for direction, length in zip((first, second), lengths, strict=True)
    ]
    n = [len(b) for b in bearings]

    def means(p):
        wall = np.repeat(p[2:4], n)
        theta = p[4:]
        ranges = (p[0] * np.sin(wall) - p[1] * np.cos(wall)) / np.sin(wall - theta)
        return np.concatenate([ranges, theta])

    parameters = [x, y, first, second, *np.concatenate(bearings)]
    assert (means(np.array(parameters))[: sum(n)] > 0).all()
    sigmas = np.repeat([noise.sigma_range, noise.sigma_bearing], sum(n))
    expected = bound_of_first_two(information(means, parameters, sigmas))
    found = corner_bound((normal_form(corner, first), normal_form(corner, second)), tuple(bearings), noise)
    assert relative(found, expected) < 1e-8


@pytest.mark.parametrize("noise", NOISES)
def test_bound_of_a_line_is_the_inverse_of_the_numeric_fisher_information(noise):
    """Parameters here: two points on the wall, at x = 0 and x = 1, and the bearings."""
    heights, bearings = np.array([2.0, 2.7]), np.radians(np.arange(40, 130, 0.7))

    def means(p):
        c, s = np.cos(p[2:]), np.sin(p[2:])
        return np.concatenate([p[0] / (s - (p[1] - p[0]) * c), p[2:]])

    sigmas = np.repeat([noise.sigma_range, noise.sigma_bearing], len(bearings))
    heights_bound = bound_of_first_two(information(means, [*heights, *bearings], sigmas))

    def normal(h):
        slope = h[1] - h[0]
        return np.array([np.pi / 2 + np.arctan(slope), h[0] / np.sqrt(1 + slope * slope)])

    J = np.array([normal(heights + 1e-100j * step).imag / 1e-100 for step in np.eye(2)]).T
    alpha, r = normal(heights)
    assert relative(line_bound(alpha, r, bearings, noise), J @ heights_bound @ J.T) < 1e-9


def test_maximum_likelihood_claims_the_bound_on_noiseless_points():
    noise, bearings = SensorNoise(0.03, 0.003), 0.4 + np.linspace(-0.9, 1.1, 80)
    line = FITTERS["ml"].fit(2.5 / np.cos(bearings - 0.4), bearings, noise)
    assert relative(line.covariance_consistent, line_bound(0.4, 2.5, bearings, noise)) < 1e-9
