"""Lines and covariances against the papers' equations, written again in law_papers.py."""

import law_papers as papers
import numpy as np
import pytest
from law_walls import ROOM_WALLS, Wall, angle_between, relative
from scipy.optimize import least_squares, root

from lidarcore import FITTERS, ExtractionSettings, Scan, SensorNoise, compare
from lidarcore.corners import intersect
from lidarcore.tables import CORNER_CONSISTENT, CORNER_FIELDS, CORNER_PUBLISHED

NOISES = [SensorNoise(0.05, 0.0035), SensorNoise(0.01, 0.001), SensorNoise(0.003, 0.01)]
TURNED = [wall.turned(turn) for wall in ROOM_WALLS for turn in (0.0, 0.7, 2.9, -1.6)]

each_wall = pytest.mark.parametrize("wall", TURNED, ids=range(len(TURNED)))
each_noise = pytest.mark.parametrize("noise", NOISES, ids=["s1", "fine", "coarse-bearing"])


def measure(wall, noise):
    return wall.measured(noise, np.random.default_rng(int(1e3 * wall.r)))


def maximum_likelihood(ranges, bearings, noise, start):
    """Root of the likelihood equations by scipy, in (alpha, r): variances at the fit.

    The covariance is the inverse information, from derivatives of r / cos(bearing - alpha).
    """

    def score(p):
        weighted = (ranges - p[1] / np.cos(bearings - p[0])) / beam_variances(p, bearings, noise)
        return information(p, bearings, noise)[1] @ (mean_derivatives(p, bearings).T @ weighted)

    line = np.array(start)
    for _ in range(3):  # started again at its result, the solver gets rid of its own tolerance
        line = root(score, line, tol=1e-15).x
    return line, information(line, bearings, noise)[1]


def information(line, bearings, noise):
    """Fisher information of (alpha, r), and its inverse."""
    J = mean_derivatives(line, bearings)
    matrix = J.T @ (J / beam_variances(line, bearings, noise)[:, None])
    return matrix, np.linalg.inv(matrix)


def beam_variances(line, bearings, noise):
    incidence = bearings - line[0]
    slope = line[1] * np.sin(incidence) / np.cos(incidence) ** 2
    return noise.sigma_range**2 + (slope * noise.sigma_bearing) ** 2


def mean_derivatives(line, bearings):
    incidence = bearings - line[0]
    return np.stack([-line[1] * np.sin(incidence) / np.cos(incidence) ** 2, 1 / np.cos(incidence)], 1)


REFERENCES = {
    "arras_siegwart": papers.arras_siegwart,
    "cwlf": papers.cwlf,
    "utls": lambda *beams: papers.implicit_line(*beams, weighted=False),
    "wtls": lambda *beams: papers.implicit_line(*beams, weighted=True),
    "wctls": papers.conformal_line,
}


@pytest.mark.parametrize("name", REFERENCES)
@each_wall
@each_noise
def test_lines_and_published_covariances_follow_the_papers(name, wall, noise):
    ranges, bearings = measure(wall, noise)
    line = FITTERS[name].fit(ranges, bearings, noise)
    (alpha, r), covariance = REFERENCES[name](ranges, bearings, noise)
    assert angle_between(line.alpha, alpha) == pytest.approx(0, abs=1e-9)
    assert line.r == pytest.approx(r, rel=1e-9)
    assert relative(line.covariance_published, covariance) < 1e-9


@pytest.mark.parametrize("weighted", [False, True])
@each_wall
def test_the_printed_derivatives_of_the_implicit_line_are_right(weighted, wall):
    """[WCTLS 7] and [15], whose signs the text lost: against complex steps of the sums [2-4, 10-12]."""
    noise = NOISES[0]
    ranges, bearings = measure(wall, noise)
    abc, *terms = papers.implicit(ranges, bearings, noise, weighted)

    def sums(rho, theta):
        return papers.implicit_sums(rho, theta, noise, weighted)

    scale = np.array([np.hypot(*abc[:2])] * 2 + [abs(abc[2])])[:, None]
    assert np.abs(abc - sums(ranges, bearings)).max() < 1e-9 * scale.max()
    by_range, by_bearing = papers.jacobian(sums, ranges, bearings)
    assert np.abs((terms[0] - by_range) * ranges / scale).max() < 1e-9
    assert np.abs((terms[1] - by_bearing) / scale).max() < 1e-9


@each_wall
@each_noise
def test_maximum_likelihood_is_what_scipy_finds(wall, noise):
    """Without latent bearings, that is with their effect on the range to first order."""
    ranges, bearings = measure(wall, noise)
    line = FITTERS["ml"].fit(ranges, bearings, noise, latent_bearings=False)
    (alpha, r), covariance = maximum_likelihood(ranges, bearings, noise, (wall.alpha, wall.r))
    assert angle_between(line.alpha, alpha) == pytest.approx(0, abs=1e-9)
    assert line.r == pytest.approx(r, rel=1e-9)
    assert relative(line.covariance_published, covariance) < 1e-9


@each_wall
@each_noise
def test_maximum_likelihood_is_near_the_full_likelihood_with_unknown_bearings(wall, noise):
    """Profile likelihood over every beam's true bearing, no linearisation at all."""
    ranges, bearings = measure(wall, noise)
    line = FITTERS["ml"].fit(ranges, bearings, noise)

    def residuals(p):
        e_range = (ranges - p[1] / np.cos(p[2:] - p[0])) / noise.sigma_range
        return np.concatenate([e_range, (bearings - p[2:]) / noise.sigma_bearing])

    start = np.concatenate([[wall.alpha, wall.r], bearings])
    alpha, r = least_squares(residuals, start, x_scale="jac", xtol=1e-12, ftol=1e-12, gtol=1e-12).x[:2]
    sigma = np.sqrt(np.diag(line.covariance_consistent))
    off = np.abs([angle_between(line.alpha, alpha), line.r - r]) / sigma
    assert off.max() < 0.5


CORNERS = [
    ("a", Wall(1.3, 2.0, np.linspace(-0.9, 0.4, 60)), Wall(2.0, 2.5, np.linspace(-0.5, 0.6, 50))),
    ("b", Wall(0.2, 2.0, np.linspace(-0.9, 0.4, 60)), Wall(-0.5, 1.5, np.linspace(-0.7, 0.3, 50))),
    ("c", Wall(0.1, 2.0, np.linspace(-0.6, 0.7, 60)), Wall(1.7, 1.2, np.linspace(-0.9, 0.6, 50))),
    ("c", Wall(1.7, 3.0, np.linspace(-0.6, 0.7, 60)), Wall(3.0, 1.2, np.linspace(-0.9, 0.6, 50))),
    ("c", Wall(-1.7, 3.0, np.linspace(-0.6, 0.7, 60)), Wall(0.3, 1.2, np.linspace(-0.9, 0.6, 50))),
]
each_corner = pytest.mark.parametrize(
    ("case", "first", "second"), CORNERS, ids=[f"{k}-{corner[0]}" for k, corner in enumerate(CORNERS)]
)


def library_corner(first, second):
    """Corner of two lines by the library: xy, published, consistent."""
    rows = [
        np.concatenate(
            [
                line.normal,
                [line.r],
                line.covariance_published.ravel(),
                line.covariance_consistent.ravel(),
                line.covariance_map.ravel(),
            ]
        )
        for line in (first, second)
    ]
    out = np.empty(CORNER_FIELDS)
    intersect(*rows, out)
    published, consistent = (out[at : at + 4].reshape(2, 2) for at in (CORNER_PUBLISHED, CORNER_CONSISTENT))
    return out[:2], published, consistent


@each_corner
@each_noise
def test_cwlf_corners_agree_in_all_cases(case, first, second, noise):
    beams = [measure(wall, noise) for wall in (first, second)]
    xy, published, _ = library_corner(*(FITTERS["cwlf"].fit(*b, noise) for b in beams))
    found_case, expected, covariance = papers.cwlf_corner(*(papers.cwlf_regression(*b, noise) for b in beams))
    assert found_case == case
    assert xy == pytest.approx(expected, rel=1e-9)
    assert relative(published, covariance) < 1e-9


@pytest.mark.parametrize("name", ["utls", "wtls", "wctls"])
@each_corner
@each_noise
def test_corners_of_implicit_lines_agree(name, case, first, second, noise):
    beams = [measure(wall, noise) for wall in (first, second)]
    xy, published, _ = library_corner(*(FITTERS[name].fit(*b, noise) for b in beams))
    if name == "wctls":
        lines = [papers.conformal_implicit(*b, noise) for b in beams]
    else:
        terms = [papers.implicit(*b, noise, weighted=name == "wtls") for b in beams]
        lines = [(abc, papers.propagate(noise, by_r, by_b)) for abc, by_r, by_b in terms]
    expected, covariance = papers.implicit_corner(*lines)
    assert xy == pytest.approx(expected, rel=1e-9)
    assert relative(published, covariance) < 1e-9


@pytest.mark.parametrize("name", FITTERS)
@each_corner
def test_corners_in_normal_form_agree(name, case, first, second):
    """[CWLF 36-39] by complex steps, for both covariances of every fitter."""
    noise = NOISES[0]
    lines = [FITTERS[name].fit(*measure(wall, noise), noise) for wall in (first, second)]

    def corner(p):
        d = np.sin(p[2] - p[0])
        return np.array(
            [
                (p[1] * np.sin(p[2]) - p[3] * np.sin(p[0])) / d,
                (p[3] * np.cos(p[0]) - p[1] * np.cos(p[2])) / d,
            ]
        )

    parameters = np.array([v for line in lines for v in (line.alpha, line.r)])
    (J,) = papers.jacobian(corner, parameters)
    xy, *covariances = library_corner(*lines)
    assert xy == pytest.approx(corner(parameters), rel=1e-9)
    for found, kind in zip(covariances, ("covariance_published", "covariance_consistent"), strict=True):
        C = np.zeros((4, 4))
        C[:2, :2], C[2:, 2:] = (getattr(line, kind) for line in lines)
        assert relative(found, J @ C @ J.T) < 1e-9


@pytest.mark.parametrize("turn", [0.0, 0.45, 1.2, -2.0])
def test_extracted_corners_have_the_published_covariances(turn):
    """From the scan to the corner by every paper's own path, refitted to the beams that the features name."""
    noise = NOISES[0]
    first, second = (wall.turned(turn) for wall in CORNERS[2][1:])
    corner_at = np.linalg.solve(
        [[np.cos(w.alpha), np.sin(w.alpha)] for w in (first, second)], [first.r, second.r]
    )
    seam = np.arctan2(corner_at[1], corner_at[0])
    bearings = seam + np.radians(0.5) * np.arange(-70, 71)
    clean = [w.r / np.cos(bearings - w.alpha) for w in (first, second)]
    ranges = np.minimum(*clean) + np.random.default_rng(3).normal(0, 0.005, len(bearings))
    scan, settings = Scan(ranges, bearings), ExtractionSettings(noise=noise)
    for name, features in compare(scan, settings).items():
        assert len(features.segments) == 2
        assert len(features.corners) == 1
        # The fit leaves out the end points of a wall, which may belong to the neighbour.
        beams = [
            (scan.ranges[a + 1 : b], scan.bearings[a + 1 : b])
            for a, b in zip(features.segments.first_beam, features.segments.last_beam, strict=True)
        ]
        if name == "cwlf":
            _, xy, covariance = papers.cwlf_corner(*(papers.cwlf_regression(*b, noise) for b in beams))
        elif name == "wctls":
            xy, covariance = papers.implicit_corner(*(papers.conformal_implicit(*b, noise) for b in beams))
        elif name in ("utls", "wtls"):
            terms = [papers.implicit(*b, noise, weighted=name == "wtls") for b in beams]
            xy, covariance = papers.implicit_corner(
                *((abc, papers.propagate(noise, by_r, by_b)) for abc, by_r, by_b in terms)
            )
        else:
            continue
        assert features.corners.xy[0] == pytest.approx(xy, rel=1e-9)
        assert relative(features.corners.covariance_published[0], covariance) < 1e-9
