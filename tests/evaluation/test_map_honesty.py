"""What maps claim of their poses, judged: claims that are true by construction, and a simulated robot's."""

import json
from dataclasses import replace

import numpy as np
from chance import SURE, fewest
from chance import band as sure_band
from lidarcore_app.cli.main import cli
from scipy.stats import chi2
from typer.testing import CliRunner

from lidarcore.errors import SimulationError
from lidarcore.evaluation.maps.honesty import band, drive, judge, judged
from lidarcore.geometry import relative
from lidarcore.simulation.worlds import place


def squares(of: float, runs: int = 60) -> list[np.ndarray]:
    """Squared normalised errors of runs of different lengths, whose errors are so many times as large as claimed."""
    rng = np.random.default_rng(1)
    return [of**2 * chi2.rvs(3, size=40 + n % 3, random_state=rng) for n in range(runs)]


def test_true_claims_are_found_true_and_others_are_not():
    """2,460 draws, whose mean square has a relative standard deviation of .0165; of 42 steps 2 lie outside the band."""
    true = judged(squares(1))
    assert abs(true.coverage.value - 0.95) < sure_band(0.95, 2460)
    assert abs(true.anees.value - 1) < SURE * 0.0165
    assert abs(true.median - chi2.median(3)) < 0.2
    assert true.steps * 42 >= fewest(42, 0.95)
    for of, shares in ((0.7, (0.98, 1)), (1.4, (0.6, 0.9))):
        wrong = judged(squares(of))
        assert shares[0] < wrong.coverage.value < shares[1]
        assert abs(wrong.anees.value / of**2 - 1) < SURE * 0.0165
        assert wrong.steps < 0.1


def test_the_band_holds_the_mean_of_so_many_runs_and_one_step_that_one_run_reached_counts_by_its_own():
    low, high = band(25)
    means = chi2.rvs(3, size=(20_000, 25), random_state=np.random.default_rng(2)).mean(axis=1) / 3
    assert abs(((low < means) & (means < high)).mean() - 0.95) < 0.008
    # A second run that ends early says nothing of the last step: 3 lies outside of the band of two runs only.
    assert judged([np.array([3.0, 9.0]), np.array([3.0])]).steps == 1
    assert judged([np.array([3.0, 9.0]), np.array([3.0, 9.0])]).steps == 0.5
    assert np.isnan(judged([np.empty(0)]).steps)


def test_drives_begin_anywhere_on_the_way_and_know_where_they_are():
    one, two = (drive("corridor", 0.3, seed) for seed in (1, 2))
    assert len(one) == 3
    passed = place("corridor").path()(np.arange(0, 120, 0.01))
    for scans in (one, two):
        np.testing.assert_allclose(np.abs(passed[:, :2] - scans[0].truth[:2]).sum(axis=1).min(), 0, atol=0.01)
    assert np.hypot(*(one[0].truth - two[0].truth)[:2]) > 0.1


def test_a_run_that_was_put_elsewhere_is_lost_and_its_errors_count():
    """A robot that is told to have been 2 m farther for its last scans, and one that is told the truth."""
    scans = drive("two rooms", 2, 1)
    right = judge(scans)
    assert not right.lost
    wrong = judge(
        [
            replace(s, truth=s.truth + np.array([2.0 * (k > 10), 0, 0])) if k else s
            for k, s in enumerate(scans)
        ]
    )
    assert wrong.lost
    assert len(wrong.squares["poses"]) == len(scans) - 1
    assert np.median(wrong.squares["poses"][12:]) > 1000


def test_the_command_prints_and_writes_the_figures_of_every_world_and_refuses_others(tmp_path):
    output = tmp_path / "honesty.json"
    command = ["evaluate", "honesty", "--seconds", "2", "--runs", "2", "--workers", "1"]
    worlds = ["--world", "corridor", "--world", "furnished room"]
    result = CliRunner().invoke(cli, [*command, *worlds, "-o", str(output)])
    assert result.exit_code == 0, result.output
    told = json.loads(output.read_text())
    assert [(one["world"], one["odometry"]) for one in told["worlds"]] == [
        (world, odometry) for world in ("corridor", "furnished room") for odometry in ("wheels", "none")
    ]
    for one in told["worlds"]:
        assert f"{one['world']}, with" in result.output
        assert (one["runs"], one["lost"], one["wrong"]) == (2, 0, 0)
        assert one["judged"].keys() == {"poses", "next keyframe", "10 keyframes"}
        assert one["judged"]["10 keyframes"]["median"] is None  # 2 s are too short
        assert 0 <= one["judged"]["poses"]["coverage"]["value"] <= 1
        assert f"{one['judged']['poses']['median']:.2f}" in result.output
    assert "nan" not in result.output
    output.unlink()
    result = CliRunner().invoke(cli, [*command, "--world", "moon", "-o", str(output)])
    assert isinstance(result.exception, SimulationError)
    assert not output.exists()


def test_poses_of_a_drive_are_judged_against_the_first():
    scans = drive("two rooms", 2, 1)
    first = scans[0].truth
    moved = [replace(scan, truth=relative(first, scan.truth)) for scan in scans]
    np.testing.assert_allclose(judge(moved).squares["poses"], judge(scans).squares["poses"], rtol=1e-6)
