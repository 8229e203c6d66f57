"""The judge judged: exact Gaussians pass, and what is made wrong on purpose is caught with the right figure."""

from dataclasses import replace

import numpy as np
import pytest
from chance import band
from scipy.stats import chi2, ncx2

from lidarcore import ExtractionSettings, SensorNoise
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.consistency.figures import FIGURES, LEVELS, SUMS, tally
from lidarcore.evaluation.consistency.places import places
from lidarcore.evaluation.consistency.trials import Trials, simulate
from lidarcore.evaluation.intervals import ratio, share
from lidarcore.simulation.rooms import rectangular_room

BLOCKS, CORNERS, DRAWS = 40, 60, 10
LOW = SensorNoise(0.004, 0.0004)  # so little that first order holds and ml is honest


def gaussian(rng):
    """Errors drawn from the covariance that is claimed, another for each of the corners, which is also the bound."""
    A = rng.normal(0, 0.01, (CORNERS, 2, 2))
    C = A @ A.swapaxes(1, 2) + 1e-5 * np.eye(2)
    e = np.einsum("pij,pkj->pki", np.linalg.cholesky(C), rng.normal(0, 1, (CORNERS, DRAWS, 2)))
    claimed = np.broadcast_to(C[:, None], (CORNERS, DRAWS, 2, 2)).copy()
    return Trials(e, claimed, C, rng.uniform(1, 5, (CORNERS, 2)))


def simulated(rng):
    """What ml makes of a room."""
    spots, n = [], 0
    for place in places(rectangular_room(4.5, 2.5), LOW, 400, rng):
        spots.append(place)
        n += len(place.corners)
        if n >= CORNERS:
            break
    return simulate(spots, "known", ExtractionSettings(noise=LOW), DRAWS, rng)["ml", "consistent"]


@pytest.fixture(scope="module", params=[gaussian, simulated], ids=["exact Gaussians", "ml in a room"])
def blocks(request):
    return [request.param(np.random.default_rng([7, i])) for i in range(BLOCKS)]


def judge(blocks):
    sums = np.array([tally(trials) for trials in blocks])
    return {name: figure.of(sums) for name, figure in FIGURES.items()}


def assert_caught(figures, **expected):
    """Within twice the half-width: four standard errors."""
    for name, value in expected.items():
        found = figures[name]
        print(f"{name}: {found.value:.4g} [{found.low:.4g}, {found.high:.4g}], expected {value:.4g}")
        assert abs(found.value - value) <= found.high - found.low, name


def coverages(inside):
    return {f"coverage_{100 * level:.0f}": inside(chi2.ppf(level, 2)) for level in LEVELS}


@pytest.mark.long
def test_an_honest_method_is_found_honest(blocks):
    figures = judge(blocks)
    assert_caught(
        figures,
        found=1,
        anees=1,
        area_ratio=1,
        actual_area=1,
        claimed_area=1,
        rms_ratio=1,
        bias_outward=0,
        bias_sideways=0,
        **coverages(lambda gate: chi2.cdf(gate, 2)),
    )
    assert figures["bias"].low == 0


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_covariance_too_small_or_too_large_is_caught(blocks, factor):
    wrong = [replace(trials, covariances=factor * trials.covariances) for trials in blocks]
    inside = coverages(lambda gate: chi2.cdf(factor * gate, 2))
    assert_caught(judge(wrong), anees=1 / factor, area_ratio=factor, actual_area=1, rms_ratio=1, **inside)


def test_a_rotated_covariance_is_caught_though_its_area_is_right(blocks):
    turn = np.array([[0, -1], [1, 0]])
    wrong = [replace(trials, covariances=turn @ trials.covariances @ turn.T) for trials in blocks]
    # e^T W^-1 e for e of covariance C is a sum of two chi-squares, weighted by the eigenvalues of W^-1 C.
    C = np.concatenate([trials.covariances.reshape(-1, 2, 2) for trials in blocks])
    weights = np.linalg.eigvals(np.linalg.solve(turn @ C @ turn.T, C)).real
    phi = np.linspace(0, np.pi, 500, endpoint=False)
    spread = weights @ [np.cos(phi) ** 2, np.sin(phi) ** 2]
    inside = coverages(lambda gate: 1 - np.exp(-gate / (2 * spread)).mean())
    assert inside["coverage_95"] < 0.9
    assert_caught(judge(wrong), area_ratio=1, anees=weights.mean(), **inside)


def test_a_shifted_estimate_is_caught_as_bias(blocks):
    """A shift that is the same in the sensor's frame has no mean along the line of sight; the bias still shows it."""
    shift = np.array([0.004, -0.007])
    wrong = [replace(trials, errors=trials.errors + shift) for trials in blocks]
    C = np.concatenate([trials.covariances.reshape(-1, 2, 2) for trials in blocks])
    offset = np.linalg.solve(C, shift[:, None])[:, :, 0] @ shift
    figures = judge(wrong)
    assert_caught(
        figures,
        bias=np.hypot(*shift),
        anees=1 + offset.mean() / 2,
        **coverages(lambda gate: ncx2.cdf(gate, 2, offset).mean()),
    )
    assert figures["bias"].low > 0


def test_an_outward_bias_shows_along_the_line_of_sight(blocks):
    def shifted(trials, outward, sideways):
        u = trials.corners / np.linalg.norm(trials.corners, axis=1, keepdims=True)
        return replace(
            trials, errors=trials.errors + (outward * u + sideways * u[:, ::-1] * [-1, 1])[:, None]
        )

    figures = judge([shifted(trials, 0.005, -0.003) for trials in blocks])
    assert_caught(figures, bias_outward=0.005, bias_sideways=-0.003, bias=np.hypot(0.005, 0.003))


def test_corners_that_were_not_found_do_not_count_otherwise(blocks):
    """Lost at random: fewer found, all else as it was."""
    rng = np.random.default_rng(3)

    def thinned(trials):
        lost = rng.random(trials.errors.shape[:2]) < 0.3
        errors, covariances = trials.errors.copy(), trials.covariances.copy()
        errors[lost], covariances[lost] = np.nan, np.nan
        return replace(trials, errors=errors, covariances=covariances)

    inside = coverages(lambda gate: chi2.cdf(gate, 2))
    assert_caught(judge([thinned(trials) for trials in blocks]), found=0.7, anees=1, area_ratio=1, **inside)


def test_nothing_found_gives_no_figures_rather_than_wrong_ones():
    trials = gaussian(np.random.default_rng(0))
    figures = judge([replace(trials, errors=np.full_like(trials.errors, np.nan))] * 3)
    assert figures.pop("found").value == 0
    assert all(np.isnan(figure.value) for figure in figures.values())


@pytest.mark.parametrize("bad", [np.diag([1, -1.0]), np.ones((2, 2)), np.full((2, 2), np.nan)])
def test_what_is_no_covariance_is_refused(bad):
    trials = gaussian(np.random.default_rng(0))
    covariances = trials.covariances.copy()
    covariances[3, 4] = bad
    with pytest.raises(EvaluationError, match="positive definite"):
        tally(replace(trials, covariances=covariances))


def test_confidence_intervals_hold_the_truth_as_often_as_they_say():
    """Blocks whose trials depend on each other: all of a block share an offset, and lie in or out together."""
    rng, repeats = np.random.default_rng(11), 600
    held = {"mean": 0, "root": 0, "share": 0}
    for _ in range(repeats):
        n = rng.integers(5, 20, 30).astype(float)
        offset = rng.normal(0, 1, 30)
        p = rng.beta(8, 2, 30)
        held["mean"] += ratio(n * (3 + offset) + rng.normal(0, np.sqrt(n)), n).contains(3)
        held["root"] += ratio(n * (9 + offset), n).root().contains(3)
        held["share"] += share(rng.binomial(n.astype(int), p).astype(float), n).contains(0.8)
    print(held)
    for name, count in held.items():
        # Student's t and Wilson's intervals are approximations here, to a hundredth.
        assert abs(count / repeats - 0.95) < band(0.95, repeats) + 0.01, name
        assert count < repeats, name


def test_a_share_of_none_or_all_still_has_an_interval():
    n = np.full(20, 50.0)
    assert 0 < share(0 * n, n).high < 0.005
    assert 0.995 < share(n, n).low < 1


def test_every_figure_is_made_of_sums_there_are():
    assert {sum for figure in FIGURES.values() for sum in (figure.numerator, figure.denominator)} <= set(SUMS)
