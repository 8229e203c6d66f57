"""The experiments of the two papers on corners, from the command to the report, and the laws their numbers obey."""

import re
import subprocess
import sys
from collections.abc import Callable
from html import escape
from pathlib import Path

import numpy as np
import pytest
from html_tables import Tables

from lidarcore import Scan
from lidarcore.corners import intersect
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.consistency.places import MIN_BEAMS, MIN_EXTENT
from lidarcore.experiments import cwlf, wctls
from lidarcore.experiments.claim_rules import RULES
from lidarcore.experiments.corner_study import recorded
from lidarcore.experiments.cwlf_claims import claims as claims_of_cwlf
from lidarcore.experiments.cwlf_steps import METHODS, corner
from lidarcore.experiments.cwlf_timing import walls_of
from lidarcore.experiments.environments import Design
from lidarcore.experiments.paper_rooms import CWLF_ROOMS, NOISE, WCTLS_ROOMS, Room
from lidarcore.experiments.wctls_claims import claims as claims_of_wctls
from lidarcore.lines import FITTERS, LINE_FIELDS
from lidarcore.noise import SensorNoise
from lidarcore.settings import ExtractionSettings
from lidarcore.simulation import SimulatedSensor
from lidarcore.tables import CORNER_FIELDS

DESIGN = Design(seed=3).quick()


@pytest.fixture(scope="module")
def of_cwlf() -> cwlf.CwlfStudy:
    return cwlf.run(DESIGN)


@pytest.fixture(scope="module")
def of_wctls() -> wctls.WctlsStudy:
    return wctls.run(Design(seed=3, split_threshold=wctls.THRESHOLD).quick())


Command = Callable[..., str]


@pytest.fixture(scope="module")
def command(tmp_path_factory: pytest.TempPathFactory) -> Command:
    """Runs the real command and gives the report; what it says is `before` and, after the report's path, `told`."""

    def run(name: str, *options: str, told: str, before: str = "") -> str:
        path = tmp_path_factory.mktemp("report") / "report.html"
        arguments = [
            sys.executable,
            "-m",
            "lidarcore_app.cli.main",
            "experiment",
            name,
            *options,
            "-o",
            str(path),
        ]
        done = subprocess.run(arguments, capture_output=True, text=True, timeout=250)
        assert (done.returncode, done.stderr) == (0, "")
        assert re.fullmatch(before + re.escape(f"{path}: ") + told + "\n", done.stdout), done.stdout
        return path.read_text("utf-8")

    return run


def assert_complete(report: str, figures: tuple[int, ...]) -> None:
    assert all(f"Figure {n}" in report for n in figures)
    assert not re.search(r"<(script|link|img|iframe)|https?://|url\(", report)
    assert not re.search(r"\bnan\b|\binf\b", report, re.IGNORECASE)


@pytest.mark.long
def test_the_tables_of_cwlf_hold_the_numbers_of_the_library(
    command: Command, of_cwlf: cwlf.CwlfStudy
) -> None:
    """The library ran in one process, the command in two."""
    claims = claims_of_cwlf(of_cwlf)
    report = command("cwlf", "--quick", "--seed", "3", "--workers", "2", told=f"{len(claims)} claims.*")
    assert_complete(report, (3, 4, 5))
    tables = Tables(report).rows
    for number, environment in zip(("I", "II"), of_cwlf.environments, strict=True):
        study = environment.study
        rows = tables[f"Table {number}. Standard deviations of the corners of {environment.name}, mm"][1:]
        assert len(rows) == len(study.corners) + 1
        columns = [
            of
            for fitter in cwlf.FITTERS
            for of in (
                study.claimed(fitter, "published"), study.claimed(fitter, "consistent"), study.scatter(fitter)
            )
        ]  # fmt: skip
        values = 1e3 * np.column_stack([*columns, study.bound])
        shown = np.array([[float(cell) for cell in row[1:]] for row in rows])
        assert np.allclose(shown[:-1], values, atol=0.051)
        assert np.allclose(shown[-1], values.mean(0), atol=0.051)
    of_corners = tables["Uncertainty of the chosen corners, mm"][1:]
    for row, u in zip(of_corners, of_cwlf.uncertainties.values(), strict=True):
        assert row[3:] == [f"{1e3 * x:.2f}" for x in (*u.published, *u.scatter, *u.bound)]
    for claim, measured, _ in claims[:10]:  # those that no clock takes part in
        assert escape(claim) in report
        assert escape(measured) in report
    assert escape(RULES) in report


def test_the_tables_of_wctls_hold_the_numbers_of_the_library(
    command: Command, of_wctls: wctls.WctlsStudy
) -> None:
    claims = claims_of_wctls(of_wctls)
    report = command("wctls", "--quick", "--seed", "3", "--workers", "1", told=f"{len(claims)} claims.*")
    assert_complete(report, (3, 4))
    rows = Tables(report).rows["Median ellipse area per scan ± standard deviation over scans, mm²"][1:]
    cells = iter(rows)
    for environment in of_wctls.environments:
        for fitter in wctls.FITTERS:
            _, title, _, published, _, true = next(cells)
            areas = 1e6 * environment.study.scan_areas(fitter, "published")
            assert title == FITTERS[fitter].title
            assert published == f"{np.median(areas):.1f} ± {areas.std(ddof=1):.1f}"
            assert true == f"{1e6 * environment.study.actual_area(fitter):.1f}"


@pytest.mark.parametrize("room", [*CWLF_ROOMS, *WCTLS_ROOMS], ids=lambda room: room.size)
def test_rooms_have_the_sizes_of_the_papers_and_show_as_many_walls_and_corners(room: Room) -> None:
    place = room.place(NOISE)
    assert len(place.corners) == room.corners
    first = np.flatnonzero(place.hit != np.roll(place.hit, 1))
    counts = np.diff(first, append=len(place.hit))
    points = place.ranges[:, None] * np.column_stack([np.cos(place.bearings), np.sin(place.bearings)])
    extents = np.linalg.norm(points[first + counts - 1] - points[first], axis=1)
    assert ((counts >= MIN_BEAMS) & (extents >= MIN_EXTENT)).sum() == len(first) == room.sections
    walls = room.world.walls.reshape(-1, 2)
    sides = [float(x) for x in room.size.removesuffix(" m").split(" x ")]
    for axis, side in enumerate(sides):  # of the room without its niches
        assert {0.0, side} <= set(walls[:, axis].round(9))


def test_the_published_ellipses_are_below_the_bound_and_hold_too_few_of_the_corners(
    of_cwlf: cwlf.CwlfStudy, of_wctls: wctls.WctlsStudy
) -> None:
    for environments, fitter in ((of_cwlf.environments, "cwlf"), (of_wctls.environments, "wctls")):
        for environment in environments:
            study = environment.study
            assert study.below_bound(fitter) == len(study.corners)
            assert study.coverage(fitter, "published").high < 0.9
            # An RMS of 100 errors varies by 1 / sqrt(200); five of that below the bound is no chance.
            assert (study.scatter(fitter) > (1 - 5 / 200**0.5) * study.bound).all()


def test_normalising_the_line_changes_no_corner_and_no_consistent_covariance(
    of_wctls: wctls.WctlsStudy,
) -> None:
    for environment in of_wctls.environments:
        one, other = (environment.study.trials[name, "consistent"] for name in ("wtls", "wctls"))
        assert np.allclose(one.errors, other.errors, rtol=0, atol=1e-9)
        assert np.allclose(one.covariances, other.covariances, rtol=1e-6, atol=0)


@pytest.mark.parametrize("name", cwlf.FITTERS)
def test_the_four_steps_together_are_what_the_library_does_at_once(name: str) -> None:
    rng = np.random.default_rng(0)
    noise = SensorNoise(0.02, 0.003)
    for room in CWLF_ROOMS:
        first, second = (
            (rho + rng.normal(0, 0.02, len(rho)), theta) for rho, theta in walls_of(room, noise, 60)
        )
        xy, covariance = corner(METHODS[name], (first, second), noise)
        rows, expected = np.empty((2, LINE_FIELDS)), np.empty(CORNER_FIELDS)
        for row, wall in zip(rows, (first, second), strict=True):
            line = FITTERS[name].fit(*wall, noise)
            matrices = line.covariance_published, line.covariance_consistent, line.covariance_map
            row[:] = [*line.normal, line.r, *np.concatenate([matrix.ravel() for matrix in matrices])]
        intersect(rows[0], rows[1], expected)
        assert np.allclose(xy, expected[:2], rtol=0, atol=1e-12)
        assert np.allclose(covariance.ravel(), expected[2:6], rtol=1e-9, atol=0)


def test_the_chosen_corners_have_the_angles_of_the_paper() -> None:
    for room, angle in zip(CWLF_ROOMS, (130, 90), strict=True):
        lines = [FITTERS["ml"].fit(*wall, NOISE) for wall in walls_of(room, NOISE, 60)]
        between = np.degrees(np.arccos(lines[0].normal @ lines[1].normal))
        assert 180 - between == pytest.approx(angle, abs=0.01)


def still_scans(noise: SensorNoise, number: int) -> list[Scan]:
    rng = np.random.default_rng(5)
    sensor = SimulatedSensor(CWLF_ROOMS[0].world, noise)
    return [sensor.scan(np.array(CWLF_ROOMS[0].pose), rng)[0] for _ in range(number)]


def test_a_recording_shows_the_scatter_that_there_is() -> None:
    noise = SensorNoise(0.01, 0.001)
    study = recorded(still_scans(noise, 60), ExtractionSettings(noise=noise), wctls.FITTERS)
    assert study.bounds is None
    true = CWLF_ROOMS[0].place(noise).corners
    apart = np.linalg.norm(study.corners[:, None] - true, axis=-1).min(1)
    assert len(study.corners) >= 0.8 * len(true)
    assert np.median(apart) < 0.01
    for fitter in ("utls", "wtls"):
        ratio = study.scatter(fitter) / study.claimed(fitter, "consistent")
        assert 0.8 < np.median(ratio) < 1.25
    turning = np.diff(np.unwrap(np.arctan2(study.corners[:, 1], study.corners[:, 0])))
    assert (turning < 0).sum() >= len(turning) - 1  # clockwise, around once


def test_recordings_that_cannot_be_used_are_refused() -> None:
    scans = still_scans(SensorNoise(0.01, 0.001), 10)
    with pytest.raises(EvaluationError, match="9 scans are too few"):
        recorded(scans[:9], ExtractionSettings(), wctls.FITTERS)
    empty = [Scan(np.full(100, np.nan), np.linspace(-3, 3, 100))] * 10
    with pytest.raises(EvaluationError, match="No corner stays where it is"):
        recorded(empty, ExtractionSettings(), wctls.FITTERS)


GOLF_ROOM = "rplidar_csv_rooms/golf_room.csv.gz"
ASSUMED = "Assumed, not measured: 50 mm of range noise (--sigma-range) and 3.49 mrad of bearing noise (--sigma-bearing)"


@pytest.mark.long
@pytest.mark.parametrize("name", ["cwlf", "wctls"])
def test_a_real_recording_makes_a_report_of_nothing_else(command: Command, data: Path, name: str) -> None:
    options = ("--recording", str(data / GOLF_ROOM), "--scans", "60", "--workers", "1")
    number = {"cwlf": 3, "wctls": 7}[name]
    before = re.escape(ASSUMED) + ".*lidarcore calibrate.*\n"
    report = command(name, *options, told=rf"{number} claims of the paper: agree \d+, .*", before=before)
    assert_complete(report, {"cwlf": (), "wctls": (3, 4)}[name])
    assert "60 scans of a recording" in report
    assert ASSUMED in report
    assert not re.search(
        "least possible|environment A|environment B|not comparable<|Time against|timed", report
    )


@pytest.mark.long
def test_of_noise_that_is_given_nothing_is_assumed(command: Command, data: Path) -> None:
    options = ("--recording", str(data / GOLF_ROOM), "--scans", "60", "--sigma-range", "0.04")
    before = re.escape("Assumed, not measured: 3.49 mrad of bearing noise (--sigma-bearing).") + ".*\n"
    assert "of range noise (--sigma-range)" not in command(
        "wctls", *options, told="7 claims.*", before=before
    )
    report = command("wctls", *options, "--sigma-bearing", "0.003", told="7 claims.*")
    assert "Assumed" not in report
    assert "40 mm and 0.172° of noise" in report
