"""The experiment of the third paper, from the command to the report, and the laws its numbers obey."""

import math
import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from chance import band

from lidarcore.evaluation.intervals import mean
from lidarcore.evaluation.workers import run_all
from lidarcore.experiments.clustering_ekf import (
    METHODS,
    MODES,
    TRAJECTORIES,
    ClusteringStudy,
    Design,
    Outcome,
    run,
    simulate,
)
from lidarcore.experiments.clustering_ekf_claims import claims, dbscan_against_others
from lidarcore.experiments.tracks import off_in_y
from lidarcore.simulation.worlds import trajectories

DESIGN = Design(runs=1, seed=3).quick()


@pytest.fixture(scope="module")
def result() -> ClusteringStudy:
    return run(DESIGN)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory, result: ClusteringStudy) -> str:
    """Written by the real command with two workers; after the result, which compiles what both need."""
    path = tmp_path_factory.mktemp("report") / "report.html"
    options = ["--quick", "--seed", "3", "--runs", "1", "--workers", "2", "--output", str(path)]
    command = [sys.executable, "-m", "lidarcore_app.cli.main", "experiment", "clustering-ekf", *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=250)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{path}: 12 drives, runs x trajectories x methods\n"
    return path.read_text("utf-8")


class Tables(HTMLParser):
    """The cells of every table by its caption, and all that is drawn."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tables: dict[str, list[list[str]]] = {}
        self.svgs: list[str] = []
        self.opened: list[str] = []
        self._rows: list[list[str]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.opened.append(tag)
        if tag == "table":
            self._rows, self._caption = [], ""
        elif tag == "tr":
            self._rows.append([])
        elif tag in ("td", "th"):
            self._rows[-1].append("")
        elif tag == "svg":
            self.svgs.append(dict(attrs)["aria-label"] or "")

    def handle_endtag(self, tag: str) -> None:
        if tag == "table":
            self.tables[self._caption] = self._rows

    def handle_data(self, data: str) -> None:
        if self.opened[-1] == "caption" and not self._rows:
            self._caption += data
        elif self.opened[-1] in ("td", "th"):
            self._rows[-1][-1] += data


@pytest.mark.long
def test_the_tables_of_the_command_hold_the_numbers_of_the_library(
    report: str, result: ClusteringStudy
) -> None:
    """The library ran them one after the other, the command on two processes."""
    tables = Tables(report).tables
    for caption, name, factor, digits in (
        ("Accumulated error, m", "accumulated", 1.0, 1),
        ("RMS distance from the true position, mm", "rms", 1e3, 0),
        ("Distance from the true position at the end, mm", "final", 1e3, 0),
    ):
        rows = tables[caption][1:]
        assert len(rows) == len(TRAJECTORIES) * len(METHODS)
        for number, row in enumerate(rows):
            t, m = divmod(number, len(METHODS))
            for mode, cell in zip(MODES, row[2:], strict=True):
                assert cell == f"{factor * result.error(mode, name)[0, t, m]:.{digits}f}"
    found = [row[-2:] for row in tables["Normalised squared error of the pose, and what was found"][1:]]
    for m, cells in enumerate(found):
        clusters = result.values(lambda o: o.clusters / o.scans)[0, :, m].mean()
        landmarks = result.values(lambda o: o.landmarks)[0, :, m].mean()
        assert cells == [f"{clusters:.2f}", f"{landmarks:.1f}"]


@pytest.mark.long
def test_every_figure_is_there_and_nothing_is_fetched(report: str) -> None:
    found = Tables(report)
    assert [f"Figure {n}" in report for n in (3, 4, 5, 6)] == [True] * 4
    assert len(found.svgs) == 3 + 3 + 1 + 36
    assert not re.search(r"<(script|link|img|iframe)|https?://|url\(", report)
    assert "NaN" not in report
    assert "inf" not in re.sub("[a-z]*inf[a-z]+", "", report)
    assert report.count('class="line lost"') == 12


@pytest.mark.long
@pytest.mark.parametrize("workers", [1, 2])
def test_outcomes_come_in_the_order_of_the_trials_whoever_works(workers: int) -> None:
    told: list[None] = []
    assert run_all(math.factorial, [20, 3, 0, 7], workers, lambda: told.append(None)) == [
        2432902008176640000, 6, 1, 5040,
    ]  # fmt: skip
    assert len(told) == 4
    with pytest.raises(ValueError, match="negative"):
        run_all(math.factorial, [2, -1, 3], workers)


def test_seeds_runs_and_trajectories_have_errors_of_their_own_and_a_run_its_objects() -> None:
    def drive(number: int, trajectory: str, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
        found = simulate(replace(DESIGN, seed=seed), number, trajectory)
        assert found.place.posts is not None
        return found.odometry[-1] - found.truth[-1], found.place.posts.centres

    (first, posts), (again, _) = drive(0, "sine"), drive(0, "sine")
    assert np.array_equal(first, again)
    for other in (drive(1, "sine"), drive(0, "sine", seed=4)):
        assert not np.allclose(first, other[0])
        assert not np.allclose(posts, other[1])
    assert not np.allclose(first, drive(0, "straight")[0])
    assert np.array_equal(posts, drive(0, "straight")[1])


@pytest.mark.long
def test_without_the_filter_the_method_makes_no_difference(result: ClusteringStudy) -> None:
    for name in ("accumulated", "rms", "anees"):
        assert np.ptp(result.error("without", name), axis=2).max() == 0


@pytest.mark.long
def test_the_filter_gains_on_odometry_and_coasts_while_objects_are_lost(result: ClusteringStudy) -> None:
    assert result.error("with", "rms").mean() < 0.4 * result.error("without", "rms").mean()
    for outcome in result.outcomes[: 3 * len(METHODS)]:
        sigma = {
            mode: np.sqrt(np.trace(track.covariances[:, :2, :2], axis1=1, axis2=2))
            for mode, track in outcome.tracks.items()
        }
        stamps = outcome.tracks["lost"].stamps
        blind = (stamps >= DESIGN.blind[0]) & (stamps < DESIGN.blind[1])
        assert (outcome.tracks["lost"].seen[blind] == 0).all()
        assert (np.diff(sigma["lost"][blind]) > 0).all()
        assert (np.diff(sigma["without"]) > 0).all()
        before = stamps < DESIGN.blind[0]
        assert np.array_equal(outcome.tracks["lost"].poses[before], outcome.tracks["with"].poses[before])
        assert sigma["with"][-1] <= sigma["lost"][-1] < sigma["without"][-1]
        assert sigma["with"][-1] < 0.5 * sigma["without"][-1]


def test_the_papers_error_is_the_distance_in_y_at_the_same_x() -> None:
    path = trajectories()["sine"]
    x = np.array([-1.0, 0.7, 4.4, 13.0, 20.5])
    poses = np.column_stack([x, 1.5 * np.sin(np.pi * x / 5) + [3, 0.2, -0.1, 0, 3], np.zeros(5)])
    assert np.allclose(off_in_y(poses, path), [0, 0.2, 0.1, 0, 0], atol=1e-4)


def with_dbscan(result: ClusteringStudy, factor: float, spread: float) -> ClusteringStudy:
    """The result with ten runs, all methods alike but for what DBSCAN's error is a multiple of."""
    rng = np.random.default_rng(0)

    def changed(outcome: Outcome, number: int) -> Outcome:
        error = 1 + 0.3 * np.sin(number)
        if outcome.method == "dbscan":
            error *= factor + spread * rng.normal()
        errors = {mode: replace(e, accumulated=error) for mode, e in outcome.errors.items()}
        return replace(outcome, run=number, errors=errors)

    first = [o for o in result.outcomes if o.run == 0]
    outcomes = [changed(outcome, number) for number in range(10) for outcome in first]
    return ClusteringStudy(replace(result.design, runs=10), outcomes)


@pytest.mark.long
def test_claims_agree_differ_or_stay_open_as_the_runs_say(result: ClusteringStudy) -> None:
    def verdict(factor: float, spread: float) -> bool | None:
        return next(
            agrees for claim, _, agrees in claims(with_dbscan(result, factor, spread)) if "5 %" in claim
        )

    assert verdict(0.95, 0.01) is True
    assert verdict(1.0, 0.01) is False
    assert verdict(0.85, 0.01) is False
    assert verdict(0.98, 0.2) is None
    assert dbscan_against_others(with_dbscan(result, 0.9, 0.0)).value == pytest.approx(-0.1)


def test_intervals_hold_the_mean_as_often_as_they_say() -> None:
    rng = np.random.default_rng(1)
    held = [mean(rng.normal(3, 2, 6)).contains(3) for _ in range(4000)]
    assert np.mean(held) == pytest.approx(0.95, abs=band(0.95, 4000))
    assert mean([2.0]).text(1) == "2.0"
    assert mean([-1.0, -2.0]).text(1, 10) == "−15.0 ± 63.5"


def test_a_report_that_cannot_be_written_is_told_before_the_work(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "lidarcore_app.cli.main", "experiment", "clustering-ekf", "-o"]
    for output in (tmp_path, tmp_path / "none" / "report.html"):
        done = subprocess.run([*command, str(output)], capture_output=True, text=True, timeout=60)
        assert done.returncode == 2
        assert (
            done.stderr
            == f"lidarcore: {output}: is not a file in a folder that exists; give one for --output\n"
        )
