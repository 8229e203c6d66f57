"""What the guide measures, against laws and other ways to measure the same."""

import numpy as np
import pytest

from docs.guide import mixing
from docs.guide.filters import filtered
from docs.guide.measurement import MIXED_NOISE
from docs.guide.views import GATE, SITUATIONS, inside, view
from docs.guide.wall import WallView, wall_view
from lidarcore import FITTERS
from lidarcore.evaluation.consistency.study import Design, study
from lidarcore.geometry import fuse


@pytest.fixture(scope="module")
def wall() -> WallView:
    return wall_view(SITUATIONS["papers"], ("wctls", "wtls"), 300, 3)


def test_equal_seeds_give_equal_dots() -> None:
    one, other, third = (view(SITUATIONS["kind"], 20, seed) for seed in (1, 1, 2))
    for fitter in FITTERS:
        assert (one.dots[fitter] == other.dots[fitter]).all()
        assert not (one.dots[fitter] == third.dots[fitter]).any()


def test_inside_is_the_share_of_a_gaussian() -> None:
    C = np.array([[4.0, 1.5], [1.5, 1.0]])
    dots = np.random.default_rng(0).multivariate_normal([0, 0], C, 100_000, method="cholesky")
    for factor in (1.0, 0.25):
        assert inside(dots, factor * C).value == pytest.approx(1 - np.exp(-factor * GATE / 2), abs=0.005)


def test_the_shadow_is_the_spread_of_the_points_and_the_slice_what_is_left_if_one_coordinate_is_known(
    wall: WallView,
) -> None:
    assert wall.spread.low < wall.shadow < wall.spread.high
    # Errors of points at one place along the wall: the residual of the regression of across on along.
    along, across = wall.points.T
    left = across - along * (along @ across) / (along @ along)
    assert np.sqrt((left**2).mean()) == pytest.approx(wall.slice, rel=0.15)


def test_the_two_formulas_on_the_page_are_those_of_the_library() -> None:
    place, noise = SITUATIONS["papers"].place(), SITUATIONS["papers"].noise
    beams = slice(place.first[0, 0], place.first[0, 0] + place.count[0, 0])
    rho, theta = place.ranges[beams], place.bearings[beams]
    line = FITTERS["wctls"].fit(rho, theta, noise)
    n, along = line.normal, np.array([-np.sin(line.alpha), np.cos(line.alpha)])
    points = rho[:, None] * np.column_stack([np.cos(theta), np.sin(theta)])
    C = noise.point_covariances(rho, theta)
    slices = 1 / np.einsum("i,kij,j->k", n, np.linalg.inv(C), n)
    shadows = np.einsum("i,kij,j->k", n, C, n)
    assert (slices <= shadows).all()
    a = np.column_stack([points @ along, -np.ones(len(points))])
    published = np.linalg.inv(np.einsum("ki,kj,k->ij", a, a, 1 / slices))
    assert np.allclose(line.covariance_published, published, rtol=1e-9, atol=0)
    step = 1e-6
    g = []
    for i in range(len(points)):  # how the method moves the line when a point moves off the wall
        moved = [points.copy(), points.copy()]
        moved[0][i] += step * n
        moved[1][i] -= step * n
        ends = [FITTERS["wctls"].fit(np.hypot(*p.T), np.arctan2(p[:, 1], p[:, 0]), noise) for p in moved]
        g.append([(ends[0].alpha - ends[1].alpha) / (2 * step), (ends[0].r - ends[1].r) / (2 * step)])
    consistent = np.einsum("ki,kj,k->ij", g, g, shadows)
    assert np.allclose(line.covariance_consistent, consistent, rtol=1e-5, atol=0)
    bound = np.linalg.inv(np.einsum("ki,kj,k->ij", a, a, 1 / shadows))
    assert np.linalg.eigvalsh(bound - line.covariance_published).min() > 0  # published is below the bound


def test_normalising_moves_no_line_and_no_consistent_ellipse(wall: WallView) -> None:
    assert np.allclose(wall.fits["wctls"], wall.fits["wtls"], rtol=0, atol=1e-12)
    assert np.allclose(wall.claims["wctls", "consistent"], wall.claims["wtls", "consistent"], rtol=1e-9)


def test_fusing_is_what_a_kalman_filter_does_one_by_one() -> None:
    rng = np.random.default_rng(1)
    A = rng.normal(size=(3, 20, 2, 2))
    claims = A @ A.transpose(0, 1, 3, 2) + 0.1 * np.eye(2)
    errors = rng.normal(size=(3, 20, 2))
    fused, C = fuse(errors, claims)
    for p in range(3):
        x, P = errors[p, 0], claims[p, 0]
        for z, R in zip(errors[p, 1:], claims[p, 1:], strict=True):
            K = P @ np.linalg.inv(P + R)
            x, P = x + K @ (z - x), P - K @ P
        assert np.allclose(fused[p], x)
        assert np.allclose(C[p], P)


def test_without_mixed_pixels_coverage_is_that_of_the_study() -> None:
    ours = mixing.covered(MIXED_NOISE, 0.0, 80, 3)
    design = Design(
        rooms=(mixing.ROOM,), noises=(MIXED_NOISE,), segmentations=("found",), trials=8000, seed=5
    )
    (its,) = (
        row.figures["coverage_95"]
        for row in study(design).pooled()
        if (row.fitter, row.covariance) == ("ml", "consistent")
    )
    assert abs(ours.value - its.value) < 2 * np.hypot(ours.half_width, its.half_width)


def test_a_filter_fed_with_true_ellipses_uses_nearly_all_corners_and_one_fed_with_too_small_ones_does_not() -> (
    None
):
    fed = filtered(SITUATIONS["papers"], [("ml", "consistent"), ("cwlf", "published")], 5, 40, 2)
    honest, small = fed.values()
    assert honest.unused.high < small.unused.low
    assert honest.anees.high < small.anees.low
    assert small.claimed.value < small.error.value
