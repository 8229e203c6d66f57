"""Scatter against claims: exact Gaussians of known covariance, a simulated sensor at rest, and a real one."""

import csv
import json
import math
from collections import Counter
from dataclasses import asdict, replace
from itertools import islice

import numpy as np
import pytest
from chance import SURE, band, holds
from lidarcore_app.cli.main import cli
from scipy import stats
from typer.testing import CliRunner

from lidarcore import ExtractionSettings, Features, Scan, SensorNoise, compare, open_recording
from lidarcore import tables as columns
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.intervals import Interval
from lidarcore.evaluation.repeatability.observations import OBSERVATION, Observations
from lidarcore.evaluation.repeatability.scatter import scatter
from lidarcore.evaluation.repeatability.statistics import Repeatability
from lidarcore.evaluation.repeatability.summary import Judgement, verdict
from lidarcore.evaluation.repeatability.tables import to_csv, to_json
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

PLACES = np.array([[2.0, 1.0], [-3.0, 2.0], [1.0, -4.0], [-2.0, -2.0], [4.0, 4.0]])
COVARIANCE = 1e-4 * np.array([[4.0, 1.5], [1.5, 1.0]])
NOISE = SensorNoise(0.01, 0.001)
METHOD = "ml"


def found(xy, covariance, published=None) -> dict[str, Features]:
    """Features with corners at xy (K, 2), each between two segments of its own, and their claims."""
    k = len(xy)
    table = np.zeros((3 * k, columns.FIELDS))
    table[: 2 * k, columns.FIRST_BEAM] = table[: 2 * k, columns.LAST_BEAM] = np.arange(2 * k)
    alpha = 3 * np.arange(2 * k) / (2 * k)
    table[: 2 * k, columns.NORMAL] = np.cos(alpha)
    table[: 2 * k, columns.NORMAL + 1] = np.sin(alpha)
    table[: 2 * k, columns.DISTANCE] = 2.0
    for end, along in ((columns.START, -0.1), (columns.END, 0.1)):
        table[: 2 * k, end] = 2 * np.cos(alpha) - along * np.sin(alpha)
        table[: 2 * k, end + 1] = 2 * np.sin(alpha) + along * np.cos(alpha)
    corners = table[2 * k :]
    corners[:, :2] = xy
    corners[:, columns.CORNER_CONSISTENT :][:, :4] = np.ravel(covariance)
    corners[:, columns.CORNER_PUBLISHED :][:, :4] = np.ravel(covariance if published is None else published)
    corners[:, columns.SEGMENTS :][:, :2] = np.arange(2 * k).reshape(k, 2)
    scan = Scan(np.ones(2 * k + 4), np.linspace(-3, 3, 2 * k + 4))
    return {METHOD: Features(scan, ExtractionSettings(), METHOD, table, (2 * k, k, 0), 0.0)}


def gaussian(scans, claim=COVARIANCE, seed=0, places=PLACES, window=100, published=None):
    """A window that has seen `scans` scans whose corners scatter by COVARIANCE."""
    rng, study = np.random.default_rng(seed), Repeatability(window, [METHOD])
    for _ in range(scans):
        study.add(
            found(
                places + rng.multivariate_normal(np.zeros(2), COVARIANCE, len(places), method="cholesky"),
                claim,
                published,
            )
        )
    return study


def of(study, kind="consistent"):
    return study.summary().methods[0].claims[kind].judgement


def standing(scans, seed=0, noise=NOISE, **settings):
    robot = SimulatedRobot(
        SimulationSettings(world="furnished room", noise=noise, seed=seed, **{"path": "standing"} | settings)
    )
    return list(islice(robot, scans))


@pytest.mark.parametrize("scans", [10, pytest.param(100, marks=pytest.mark.long)])
def test_of_true_claims_coverage_and_area_are_right_however_few_scans_there_are(scans):
    """Of 10 scans a residual from their own mean is 10 % smaller in variance: what is not corrected would show."""
    judged = [of(gaussian(scans, seed=seed)) for seed in range(6_000 // (scans * len(PLACES)))]
    trials = len(judged) * scans * len(PLACES)
    for name, level in (("coverage_50", 0.5), ("coverage_95", 0.95), ("coverage_99", 0.99)):
        share = np.mean([getattr(j, name).value for j in judged])
        assert share == pytest.approx(level, abs=band(level, trials))
    actual = np.mean([1 / j.area_ratio.value for j in judged])
    assert actual == pytest.approx(1, abs=SURE / np.sqrt(trials * 0.8))


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_claim_halved_or_doubled_is_caught_with_its_figure(factor):
    summary = gaussian(100, factor * COVARIANCE, published=COVARIANCE).summary()
    wrong, right = (summary.methods[0].claims[kind].judgement for kind in ("consistent", "published"))
    for name, level in (("coverage_50", 0.5), ("coverage_95", 0.95), ("coverage_99", 0.99)):
        expected = stats.chi2(2).cdf(factor * stats.chi2(2).ppf(level))
        assert holds(getattr(wrong, name), expected)
        if level < 0.99:  # of 500 sightings none outside is no wonder where 5 are expected
            assert not holds(getattr(wrong, name), level)
        assert holds(getattr(right, name), level)
    claims = summary.methods[0].claims
    assert claims["consistent"].verdict == ("too small" if factor < 1 else "too large")
    assert claims["published"].verdict == "true"
    assert holds(wrong.area_ratio, factor)
    assert not holds(wrong.area_ratio, 1)
    for corner in summary.methods[0].corners:
        claimed = corner.claims["consistent"]
        np.testing.assert_allclose(claimed.covariance, factor * COVARIANCE)
        assert claimed.area == pytest.approx(np.pi * factor * np.sqrt(np.linalg.det(COVARIANCE)))


def verdicts(corners, claim, studies, seed=0):
    """Shares of the verdicts on ellipses `claim` times the true covariance (2, 2), of corners seen in 100 scans."""
    rng, scans = np.random.default_rng(seed), 100
    table = np.zeros((corners * scans, studies, OBSERVATION))
    table[..., :2] = rng.normal(size=(corners * scans, studies, 2))
    table[..., 2:6] = table[..., 6:] = np.ravel(claim)
    ids, at = np.repeat(np.arange(corners), scans), np.tile(np.arange(scans), corners)
    found = scatter(Observations(ids, at, table), scans)
    words = Counter(verdict(published) for published, _ in found.judgements())
    return {word: words[word] / studies for word in ("true", "too small", "too large", "open")}


@pytest.mark.long
@pytest.mark.parametrize(("corners", "believed"), [(1, 0.1), (5, 0.95), (10, 0.99)])
def test_honest_ellipses_are_hardly_ever_called_wrong_and_believed_once_enough_is_seen(corners, believed):
    """Of one corner's hundred scans it is mostly open."""
    told = verdicts(corners, np.eye(2), 3000)
    assert max(told["too small"], told["too large"]) <= 0.006, told
    assert told["true"] >= believed, told


@pytest.mark.long
@pytest.mark.parametrize("corners", [1, 3, 10])
@pytest.mark.parametrize(("sigmas", "word"), [(1 / 1.5, "too small"), (1.5, "too large"), (7.6, "too large")])
def test_ellipses_wrong_by_half_a_sigma_are_caught_even_of_one_corner(corners, sigmas, word):
    """7.6 sigmas are 58 times the area, of which the 95 % ellipses alone say nothing: they hold all of 100 scans."""
    told = verdicts(corners, sigmas**2 * np.eye(2), 1000)
    assert told[word] >= 0.99, told
    assert told["true"] == 0


def test_ellipses_of_a_wrong_shape_are_not_true_though_they_hold_95_in_100():
    """Far too wide in one direction, a little too narrow in the other."""
    shape = np.diag([100.0, 1.0]) * stats.norm.ppf(0.975) ** 2 / stats.chi2(2).ppf(0.95)
    told = verdicts(10, shape, 300)
    assert told["too large"] > 0.95, told


@pytest.mark.parametrize(
    ("in_95", "in_50", "word"),
    [
        ((0.93, 0.97), (0.46, 0.54), "true"), ((0.90, 0.985), (0.40, 0.60), "true"),
        ((0.89, 0.97), (0.46, 0.54), "open"), ((0.94, 0.99), (0.46, 0.54), "open"),
        ((0.93, 0.97), (0.56, 0.70), "too large"), ((0.93, 0.97), (0.30, 0.44), "too small"),
        ((0.80, 0.92), (0.60, 0.70), "open"), ((0.98, 1.00), (0.30, 0.40), "open"),
        ((0.80, 0.92), (0.46, 0.54), "too small"), ((0.98, 1.00), (0.46, 0.54), "too large"),
        ((math.nan, math.nan), (math.nan, math.nan), None),
    ],
)  # fmt: skip
def test_whole_intervals_decide_and_where_they_contradict_each_other_neither_does(in_95, in_50, word):
    half, most = (Interval((low + high) / 2, low, high) for low, high in (in_50, in_95))
    assert verdict(Judgement(half, half, most, most)) == word


@pytest.mark.long
def test_intervals_hold_the_truth_as_often_as_they_say():
    held, studies = np.zeros(4), 150
    single = []
    for seed in range(studies):
        method = gaussian(20, seed=seed, window=20).summary().methods[0]
        j = method.claims["consistent"].judgement
        held += [
            j.area_ratio.contains(1),
            j.coverage_50.contains(0.5),
            j.coverage_95.contains(0.95),
            j.coverage_99.contains(0.99),
        ]
        single += [c.claims["consistent"].judgement.area_ratio.contains(1) for c in method.corners]
    assert (held / studies > 0.88).all(), held
    assert np.mean(single) == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / len(single)))


def test_scatter_and_mean_are_those_of_numpy_over_the_last_scans_only():
    rng, study, window = np.random.default_rng(3), Repeatability(25, [METHOD]), []
    for _ in range(70):
        window.append(
            PLACES + rng.multivariate_normal(np.zeros(2), COVARIANCE, len(PLACES), method="cholesky")
        )
        study.add(found(window[-1], COVARIANCE))
    summary, last = study.summary(), np.array(window[-25:])
    assert (summary.scans, summary.window, summary.message) == (25, 25, None)
    for k, corner in enumerate(summary.methods[0].corners):
        assert corner.count == 25
        np.testing.assert_allclose(corner.mean, last[:, k].mean(0))
        np.testing.assert_allclose(corner.scatter, np.cov(last[:, k].T))
        deviations = study.deviations(corner.id)[METHOD]
        np.testing.assert_allclose(deviations, last[:, k] - last[:, k].mean(0), atol=1e-15)
    with pytest.raises(EvaluationError, match="no corner 999"):
        study.deviations(999)


def test_corners_that_vanish_and_come_back_are_the_same_and_counted_when_seen():
    rng, study = np.random.default_rng(4), Repeatability(100, [METHOD])
    for i in range(100):
        there = PLACES if not 30 <= i < 70 else PLACES[:-2]
        study.add(
            found(
                there + rng.multivariate_normal(np.zeros(2), COVARIANCE, len(there), method="cholesky"),
                COVARIANCE,
            )
        )
    method = study.summary().methods[0]
    assert [corner.count for corner in method.corners] == [100, 100, 100, 60, 60]
    assert holds(method.claims["consistent"].judgement.area_ratio, 1)


def test_a_corner_seen_double_now_and_then_stays_one():
    """A wall falsely split: for one scan there is a corner to either side of the true one."""
    rng, study, aside = np.random.default_rng(0), Repeatability(100, [METHOD]), np.array([0.15, 0.0])
    for i in range(100):
        double = i % 13 == 12
        there = np.concatenate([PLACES[:1] - aside * double, PLACES[1:], (PLACES[:1] + aside)[: int(double)]])
        study.add(found(there + rng.normal(0, 0.01, there.shape), COVARIANCE))
    assert [corner.count for corner in study.summary().methods[0].corners] == [100] * len(PLACES)


def test_boxes_are_quartiles_of_each_scans_median_and_whiskers_end_at_a_value():
    rng, study, medians = np.random.default_rng(5), Repeatability(50, [METHOD]), []
    for i in range(50):
        scales = rng.uniform(0.5, 2, len(PLACES)) * (20 if i == 7 else 1)
        features = found(PLACES + rng.normal(0, 0.01, PLACES.shape), COVARIANCE)
        features[METHOD].corners.covariance_consistent[:] = scales[:, None, None] * COVARIANCE
        medians.append(np.median(np.pi * scales * np.sqrt(np.linalg.det(COVARIANCE))))
        study.add(features)
    box = study.summary().methods[0].claims["consistent"].areas
    first, median, third = np.quantile(medians, (0.25, 0.5, 0.75))
    assert (box.first_quartile, box.median, box.third_quartile) == pytest.approx((first, median, third))
    inside = [m for m in medians if first - 1.5 * (third - first) <= m <= third + 1.5 * (third - first)]
    assert (box.low, box.high) == pytest.approx((min(inside), max(inside)))
    assert box.outliers == pytest.approx(sorted(set(medians) - set(inside)))
    assert box.outliers[-1] == pytest.approx(medians[7])


@pytest.mark.long
def test_a_sensor_at_rest_is_not_said_to_move():
    rng, study = np.random.default_rng(6), Repeatability(100, [METHOD])
    for _ in range(1500):
        study.add(
            found(
                PLACES + rng.multivariate_normal(np.zeros(2), COVARIANCE, len(PLACES), method="cholesky"),
                0.01 * COVARIANCE,
            )
        )
        assert len(study) > 0
    assert study.summary().message is None


@pytest.mark.parametrize("step", [0.001, 0.05, 1.0])
def test_a_sensor_that_is_pushed_is_noticed_and_the_window_begins_anew(step):
    """By 1 mm a scan for ten seconds, or 5 cm, or a metre, at once."""
    rng, study = np.random.default_rng(7), Repeatability(100, [METHOD])
    at, said = np.zeros(2), []
    for i in range(160):
        at = at + (step if 60 <= i < (160 if step < 0.01 else 61) else 0)
        study.add(found(PLACES - at + rng.normal(0, 0.005, PLACES.shape), 25e-6 * np.eye(2)))
        said.append(study.summary().message or "")
    assert not any(said[10:60])
    assert "9 scans so far" in said[8]
    first = next(i for i, message in enumerate(said) if "moved" in message)
    assert "moved just now" in said[first]
    assert not any("moved 0" in message for message in said)
    assert first < 60 + 40
    if step > 0.01:
        assert study.summary().scans == 160 - first - 1
        assert holds(of(study).area_ratio, 1)


def test_one_corner_that_moves_alone_is_no_sensor_that_moves():
    rng, study = np.random.default_rng(8), Repeatability(100, [METHOD])
    for i in range(100):
        moved = PLACES + np.array([0.002 * i, 0]) * (np.arange(len(PLACES)) == 0)[:, None]
        study.add(found(moved + rng.normal(0, 0.005, PLACES.shape), 25e-6 * np.eye(2)))
    assert study.summary().message is None


def test_of_a_simulated_sensor_at_rest_consistent_claims_hold_and_those_of_cwlf_do_not():
    study = Repeatability()
    for scan in standing(100):
        study.add(compare(scan, ExtractionSettings(noise=NOISE)))
    summary = study.summary()
    assert summary.message is None
    for method in summary.methods:
        assert len(method.corners) >= 8
        consistent, published = (method.claims[kind].judgement for kind in ("consistent", "published"))
        assert holds(consistent.coverage_95, 0.95)
        assert consistent.coverage_95.half_width < 0.025  # so one of 0.89 would be caught
        if method.name in ("cwlf", "wctls"):
            assert published.coverage_95.high < 0.75
            assert published.area_ratio.high < consistent.area_ratio.low
            assert method.claims["published"].areas.high < method.claims["consistent"].areas.low


def test_a_simulated_sensor_that_drives_is_noticed():
    study = Repeatability(methods=[METHOD])
    for scan in standing(40, path="figure of eight"):
        study.add(compare(scan, ExtractionSettings(noise=NOISE), study.methods))
    assert "The sensor moved" in study.summary().message


def test_a_sensor_without_noise_and_one_that_sees_nothing_give_figures_that_can_be_told():
    study = Repeatability(methods=[METHOD])
    for _ in range(20):
        study.add(found(PLACES, COVARIANCE))
    assert of(study).coverage_50.value == 1
    empty = Repeatability(methods=[METHOD])
    assert empty.summary().scans == 0
    for _ in range(20):
        empty.add(found(PLACES[:0], COVARIANCE))
    assert "No corner was seen in 10 of the last 20 scans" in empty.summary().message
    assert empty.summary().methods[0].claims["consistent"].verdict is None
    for each in (study, empty):
        assert "NaN" not in to_json(each.summary())
        assert "nan" not in to_csv(each.summary())


def test_what_makes_no_sense_is_refused_and_changes_nothing():
    with pytest.raises(EvaluationError, match="9 scans is too short"):
        Repeatability(9)
    with pytest.raises(EvaluationError, match="best"):
        Repeatability(methods=["best"])
    with pytest.raises(EvaluationError, match="No method"):
        Repeatability(methods=[])
    study = Repeatability(methods=[METHOD, "cwlf"])
    with pytest.raises(EvaluationError, match="lack cwlf"):
        study.add(found(PLACES, COVARIANCE))
    assert len(study) == 0


@pytest.mark.long
@pytest.mark.real_data
def test_of_a_real_sensor_moved_from_station_to_station_each_move_is_noticed(data):
    """401 revolutions at a station. The third move, of 0.2 m, one of two corners survives: that shows as a drift only,
    after a third of the window."""
    study, moved, before = Repeatability(methods=[METHOD]), [], 0
    for i, scan in enumerate(
        islice(open_recording(data / "rplidar_csv_rooms" / "mapping_keng.csv.gz"), 1250)
    ):
        study.add(compare(scan, ExtractionSettings(noise=SensorNoise(0.01, 0.003)), study.methods))
        if len(study) < before:
            moved.append(i)
        before = len(study)
    assert [int(i // 401) for i in moved] == [1, 2, 3], moved
    assert all(i % 401 < 20 for i in moved[:2]), moved
    assert moved[2] % 401 < 40, moved


@pytest.mark.real_data
@pytest.mark.parametrize("suffix", [".json", ".csv"])
def test_the_command_tells_and_writes_what_the_library_finds(data, tmp_path, suffix):
    recording, output = data / "rplidar_csv_rooms" / "mapping_keng.csv.gz", tmp_path / f"out{suffix}"
    arguments = ["evaluate", "repeatability", str(recording), "--skip", "5", "--methods", "ml,cwlf"]
    arguments += ["--set", "noise.sigma_range=0.003", "-o", str(output)]
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code == 0, result.output
    assert "in the last 100 scans" in result.output
    study = Repeatability(methods=["ml", "cwlf"])
    settings = ExtractionSettings(noise=replace(ExtractionSettings().noise, sigma_range=0.003))
    for scan in islice(open_recording(recording), 5, 105):
        study.add(compare(scan, settings, study.methods))
    if suffix == ".json":
        assert json.loads(output.read_text()) == json.loads(json.dumps(asdict(study.summary())))
    else:
        rows = list(csv.DictReader(output.read_text().splitlines()))
        assert [(row["of"], row["fitter"], row["covariance"]) for row in rows] == [
            (of, name, kind)
            for of in ("corners", "walls")
            for name in ("ml", "cwlf")
            for kind in ("published", "consistent")
        ]
        assert float(rows[1]["coverage_95"]) == of(study).coverage_95.value


@pytest.fixture
def recorded(tmp_path):
    """Makes a file of a simulated sensor's scans."""

    def make(scans, **settings):
        path, taken = tmp_path / "simulated.npz", standing(scans, **settings)
        ranges = [scan.ranges for scan in taken]
        bearings = [scan.bearings for scan in taken]
        with path.open("wb") as file:
            np.savez(file, ranges=ranges, bearings=bearings, stamps=0.1 * np.arange(scans))
        return str(path)

    return make


def command(*arguments):
    return CliRunner().invoke(cli, ["evaluate", "repeatability", *arguments])


@pytest.mark.parametrize(
    ("scans", "settings", "extra", "said"),
    [
        (20, {"path": "figure of eight"}, [], "The sensor moves in this recording"),
        (8, {}, [], "8 scans so far: a corner is judged from 10 on"),
        (12, {}, ["--skip", "12"], "0 scans so far"),
        (12, {}, ["--set", "min_points=400"], "No corner was seen in 10 of the last 12 scans"),
    ],
)
def test_the_command_says_why_if_no_corner_can_be_judged_and_writes_nothing(
    recorded, tmp_path, scans, settings, extra, said
):
    output = tmp_path / "out.json"
    result = command(recorded(scans, **settings), "--methods", METHOD, "-o", str(output), *extra)
    assert isinstance(result.exception, EvaluationError)
    assert said in str(result.exception)
    assert not output.exists()


def test_the_command_tells_the_verdict_in_words(recorded):
    path = recorded(30)
    for sigma, word in ((0.05, "too large"), (0.002, "too small")):
        result = command(path, "--methods", METHOD, "--set", f"noise.sigma_range={sigma}")
        assert result.exit_code == 0, result.output
        assert "ellipses are" in result.output
        assert result.output.count(word) == 4  # corners and walls, both covariances


def test_the_command_refuses_a_file_of_another_kind_before_it_works(tmp_path):
    arguments = ["evaluate", "repeatability", "nothing.csv", "-o", str(tmp_path / "out.txt")]
    result = CliRunner().invoke(cli, arguments)
    assert isinstance(result.exception, EvaluationError)
