"""Agreement of walls and corners from two places against Gaussian errors of known covariance and size."""

import json

import numpy as np
import pytest
from chance import band
from lidarcore_app.cli.main import cli
from scipy import stats
from typer.testing import CliRunner

from lidarcore.errors import EvaluationError
from lidarcore.evaluation.stations.agreement import GATE, Pair, coverage, differences, systematic_part
from lidarcore.evaluation.stations.feature_set import FeatureSet, moved
from lidarcore.geometry import act, inverse

ROOM = np.array([[0, 0], [4, 0], [4, 1.5], [6, 1.5], [6, 5], [0, 5]], np.float64)
"""Six walls, with corners where each meets the next."""
HERE, THERE = np.array([2.0, 2.0, 0.3]), np.array([2.3, 2.4, 0.1])
SIGMA_ALPHA, SIGMA_R = 0.003, 0.004


def look(pose, rng, tau=0.0, error=1.0):
    """The room from a pose, each line off by Gaussian errors, and by a systematic part of each wall."""
    ends = act(inverse(pose), np.stack([ROOM, np.roll(ROOM, -1, 0)], 1))
    along = ends[:, 1] - ends[:, 0]
    normal = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(*along.T)[:, None]
    r = (normal * ends[:, 0]).sum(1)
    normal *= np.sign(r)[:, None]
    alpha, r = np.arctan2(normal[:, 1], normal[:, 0]), np.abs(r)
    middle = ends.mean(1)
    t = middle[:, 1] * np.cos(alpha) - middle[:, 0] * np.sin(alpha)
    d_alpha, off = error * rng.normal(0, SIGMA_ALPHA, 6), error * rng.normal(0, SIGMA_R, 6)
    tilt = tau * rng.normal(size=6) / (np.hypot(*along.T) / 2)
    d_alpha, d_r = d_alpha + tilt, off + t * (d_alpha + tilt) + tau * rng.normal(size=6)
    g = np.stack([np.ones(6), t], -1)
    covariances = SIGMA_ALPHA**2 * g[:, :, None] * g[:, None]
    covariances[:, 1, 1] += SIGMA_R**2
    lines = np.column_stack([alpha + d_alpha, r + d_r])
    walls = np.column_stack([np.arange(6), (np.arange(6) + 1) % 6])
    n = np.stack([np.cos(lines[walls, 0]), np.sin(lines[walls, 0])], -1)
    corners = np.linalg.solve(n, lines[walls, 1][..., None])[..., 0]
    plain = FeatureSet(lines, ends, covariances, corners, np.zeros((6, 2, 2)), walls)
    return FeatureSet(lines, ends, covariances, corners, plain._of_corners(covariances), walls)


def pairs(count, seed=0, tau=0.0, error=1.0):
    rng = np.random.default_rng(seed)
    guess = np.array([0.37, 0.27, -0.19])  # near enough to know which wall is which
    return [Pair(look(HERE, rng, tau, error), look(THERE, rng, tau, error), guess) for _ in range(count)]


def squares(found, what):
    return np.concatenate([getattr(d, what) for d in found])


@pytest.mark.parametrize("what", ["walls", "corners"])
def test_of_true_claims_differences_are_chi_square_though_the_pose_is_made_of_the_same_walls(what):
    """1,200 differences: a share of 0.95 is known to 0.0063, one of a half to 0.0144; five of these are allowed."""
    d = squares([differences(pair) for pair in pairs(200)], what)
    assert len(d) == 1200
    for level in (0.5, 0.95):
        held = np.mean(d <= stats.chi2(2).ppf(level))
        assert held == pytest.approx(level, abs=band(level, 1200))


def test_claims_that_are_too_small_are_caught():
    """Errors twice as large as claimed: 95 % ellipses hold 1 - 0.05^(1/4) of them."""
    d, share = squares([differences(pair) for pair in pairs(150, error=2.0)], "walls"), 1 - 0.05**0.25
    assert np.mean(d <= GATE) == pytest.approx(share, abs=band(share, len(d)))


@pytest.mark.long
def test_the_systematic_part_is_found_and_mends_the_claims_of_walls_and_corners():
    """Its size follows from a coverage: of 600 differences to a tenth or so."""
    groups = [pairs(25, seed, tau=0.006) for seed in range(4)]
    assert coverage(groups, 0.0) < 0.85
    tau = systematic_part(groups)
    assert tau == pytest.approx(0.006, rel=0.35)
    fresh = [differences(pair, 0.006) for pair in pairs(200, 99, tau=0.006)]
    for what in ("walls", "corners"):
        d = squares(fresh, what)
        assert np.mean(d <= GATE) == pytest.approx(
            0.95, abs=band(0.95, len(d)) + 0.01
        )  # as far as tau is known
    assert systematic_part([pairs(25, 5)]) < 0.003


def test_lines_move_as_their_points_do_and_jacobians_are_those_of_finite_differences():
    rng = np.random.default_rng(1)
    lines, pose = np.column_stack([rng.uniform(-3, 3, 5), rng.uniform(1, 5, 5)]), np.array([0.4, -0.7, 0.9])
    there, by_pose, by_line = moved(lines, pose)
    feet = lines[:, 1:] * np.column_stack([np.cos(lines[:, 0]), np.sin(lines[:, 0])])
    on = act(pose, feet)
    np.testing.assert_allclose(np.cos(there[:, 0]) * on[:, 0] + np.sin(there[:, 0]) * on[:, 1], there[:, 1])
    h = 1e-6
    for k in range(3):
        step = h * np.eye(3)[k]
        numeric = (moved(lines, pose + step)[0] - moved(lines, pose - step)[0]) / (2 * h)
        np.testing.assert_allclose(by_pose[:, :, k], numeric, atol=1e-8)
    for k in range(2):
        step = h * np.eye(2)[k]
        numeric = (moved(lines + step, pose)[0] - moved(lines - step, pose)[0]) / (2 * h)
        np.testing.assert_allclose(by_line[:, :, k], numeric, atol=1e-8)


def test_looks_that_share_nothing_have_no_differences():
    rng = np.random.default_rng(2)
    nothing = FeatureSet(
        np.empty((0, 2)),
        np.empty((0, 2, 2)),
        np.empty((0, 2, 2)),
        np.empty((0, 2)),
        np.empty((0, 2, 2)),
        np.empty((0, 2), np.int64),
    )
    for pair in (Pair(look(HERE, rng), nothing, np.zeros(3)), Pair(nothing, look(HERE, rng), np.zeros(3))):
        found = differences(pair, 0.002)
        assert len(found.walls) == len(found.corners) == 0


@pytest.mark.long
@pytest.mark.real_data
def test_neighbouring_real_stations_agree_once_the_systematic_part_is_known(data, tmp_path):
    """It is told by one half of the pairs of stations and judged on the other; it only ever adds to what is claimed.

    Here it is nothing: unevenness, as it was found at each station, explains by itself what differs between them. What
    repeats from scan to scan is another question: ellipses for it are too small between stations.
    """
    output = tmp_path / "agreement.json"
    recording = data / "rplidar_csv_rooms" / "mapping_keng.csv.gz"
    result = CliRunner().invoke(cli, ["evaluate", "agreement", str(recording), "-o", str(output)])
    assert result.exit_code == 0, result.output
    told = json.loads(output.read_text())
    assert 0.93 <= told["systematic"]["walls"]["value"] <= 0.98
    assert 0.8 <= told["consistent"]["walls"]["value"] < 0.93
    assert told["systematic"]["differences"] > 500
    assert len(told["systematic"]["pairs"]) == 11
    assert all(0 <= part < 0.002 for part in told["systematic"]["systematic"])


@pytest.mark.real_data
def test_a_recording_from_one_place_alone_cannot_show_agreement(data):
    recording = data / "rplidar_csv_rooms" / "golf_room.csv.gz"
    result = CliRunner().invoke(cli, ["evaluate", "agreement", str(recording)])
    assert isinstance(result.exception, EvaluationError)
    assert "three places or more" in str(result.exception)
