"""Calibration against simulated truth, and on stations where a real sensor stood still."""

import csv
import gzip
import json
from dataclasses import replace
from itertools import groupby, islice

import numpy as np
import pytest
from pydantic_core import to_json
from typer.testing import CliRunner

from app.calibration_wire import calibration_json
from app.cli import cli
from app.cli_options import settings_from
from lidarcore import Scan, SensorNoise, open_recording
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.calibration import calibrate
from lidarcore.evaluation.intervals import Interval
from lidarcore.evaluation.variances import variance_model
from lidarcore.simulation import SimulatedSensor, furnished_room, random_pose
from lidarcore.simulation.rooms import rectangular_room
from lidarcore.simulation.world import World

SCANS = 60


def standing(noise, seed, world=None, scans=SCANS):
    world, rng = world or furnished_room(), np.random.default_rng(seed)
    sensor, pose = SimulatedSensor(world, noise), random_pose(world, rng)
    return [sensor.scan(pose, rng)[0] for _ in range(scans)]


def assert_near(found: Interval, truth: float) -> None:
    """Within twice the half-width, about four standard errors."""
    print(f"{found.value:.6f} [{found.low:.6f}, {found.high:.6f}], truth {truth:.6f}")
    assert abs(found.value - truth) <= found.high - found.low


@pytest.mark.parametrize("world", [furnished_room(), rectangular_room(4.5, 2.5)], ids=["furnished", "small"])
@pytest.mark.parametrize(
    "noise",
    [
        SensorNoise(0.005, 0.001),
        SensorNoise(0.02, 0.001),
        SensorNoise(0.02, 0.0034),
        SensorNoise(0.05, 0.0068),
    ],
)
def test_both_sigmas_of_a_simulated_sensor_are_found(world, noise):
    result = calibrate(standing(noise, 1, world))
    assert_near(result.sigma_range, noise.sigma_range)
    assert_near(result.sigma_bearing, noise.sigma_bearing)
    assert result.sigma_range.high - result.sigma_range.low < 0.05 * noise.sigma_range
    assert result.noise == SensorNoise(result.sigma_range.value, result.sigma_bearing.value)
    # The noise is the same everywhere, and found to be so in every band.
    assert min(result.by_range.p_value, result.by_incidence.p_value) > 1e-3
    for band in (*result.by_range.sigmas, *result.by_incidence.sigmas):
        assert_near(band, noise.sigma_range)
    assert result.outliers.value < 1e-4
    assert result.drift < 3 * noise.sigma_range


def test_intervals_hold_the_truth_as_often_as_they_say():
    rng, held, repeats = np.random.default_rng(5), np.zeros(2), 300
    for _ in range(repeats):
        lever2, dof = rng.uniform(0, 4, 200) ** 2, rng.integers(10, 60, 200).astype(float)
        variances = (0.01**2 + lever2 * 0.003**2) * rng.chisquare(dof) / dof
        result = variance_model(variances, dof, lever2, lever2, 1)
        held += [result.sigmas[0].contains(0.01), result.slope.contains(0.003)]
    print(held / repeats)
    assert (held > 0.9 * repeats).all()
    assert (held < 0.985 * repeats).all()


def test_noise_that_grows_with_range_is_seen_in_the_bands():
    rng = np.random.default_rng(0)
    scans = [
        replace(scan, ranges=scan.ranges + rng.normal(0, 1, len(scan)) * 0.005 * scan.ranges)
        for scan in standing(SensorNoise(0.005, 0.001), 2)
    ]
    result = calibrate(scans)
    assert result.by_range.p_value < 1e-6
    edges = np.array(result.by_range.edges)
    for low, high, sigma in zip(edges[:-1], edges[1:], result.by_range.sigmas, strict=True):
        assert np.hypot(0.005, 0.005 * low) * 0.97 < sigma.value < np.hypot(0.005, 0.005 * high) * 1.03


def test_outliers_are_counted_and_do_not_spoil_the_sigmas():
    rng, noise = np.random.default_rng(0), SensorNoise(0.01, 0.002)
    scans = standing(noise, 3)
    for i, scan in enumerate(scans):
        bad = rng.random(len(scan)) < 0.01
        scans[i] = replace(
            scan, ranges=np.where(bad, scan.ranges * rng.uniform(0.2, 0.8, len(scan)), scan.ranges)
        )
    result = calibrate(scans)
    assert_near(result.outliers, 0.01)
    assert_near(result.sigma_range, noise.sigma_range)
    assert_near(result.sigma_bearing, noise.sigma_bearing)


def test_walls_that_are_not_quite_straight_do_not_count_as_noise():
    """A bump of 4 mm that is there in every scan."""
    noise = SensorNoise(0.005, 0.001)
    scans = [
        replace(scan, ranges=scan.ranges + 0.004 * np.sin(6 * scan.bearings)) for scan in standing(noise, 4)
    ]
    result = calibrate(scans)
    assert_near(result.sigma_range, noise.sigma_range)


def test_a_sensor_that_moves_is_refused():
    scans = standing(SensorNoise(0.01, 0.001), 5)
    moving = [replace(scan, ranges=scan.ranges + 0.002 * i) for i, scan in enumerate(scans)]
    with pytest.raises(EvaluationError, match="stands still"):
        calibrate(moving)


def test_too_few_scans_are_refused():
    with pytest.raises(EvaluationError, match="9 scans are too few"):
        calibrate(standing(SensorNoise(0.01, 0.001), 6, scans=9))


def test_a_place_without_walls_is_refused():
    nothing = Scan(np.full(360, np.nan), np.linspace(-3, 3, 360))
    with pytest.raises(EvaluationError, match="No walls"):
        calibrate([nothing] * 20)


def test_a_single_short_wall_is_refused():
    world = World(np.array([[[1.0, -0.08], [1.0, 0.08]]]))
    sensor, rng = SimulatedSensor(world, SensorNoise(0.002, 0.0005), beams=3600), np.random.default_rng(0)
    with pytest.raises(EvaluationError, match=r"longer walls|No walls"):
        calibrate([sensor.scan(np.zeros(3), rng)[0] for _ in range(20)])


def test_what_a_bearing_error_does_cannot_be_seen_on_walls_square_to_the_beam():
    """A narrow view of one wall says nothing on sigma_bearing: its interval reaches down to 0."""
    world = World(np.array([[[2.0, -3.0], [2.0, 3.0]]]))
    sensor, rng = SimulatedSensor(world, SensorNoise(0.02, 0.001), beams=3600), np.random.default_rng(0)
    scans = []
    for _ in range(30):
        scan = sensor.scan(np.zeros(3), rng)[0]
        scans.append(replace(scan, ranges=np.where(np.abs(scan.bearings) < 0.15, scan.ranges, np.nan)))
    result = calibrate(scans)
    assert_near(result.sigma_range, 0.02)
    assert result.sigma_bearing.low == 0


@pytest.mark.real_data
@pytest.mark.parametrize("station", ["1", "2", "5"])
def test_a_real_sensor_at_rest_has_more_noise_far_away(data, station):
    """Stations of a triangulating RPLIDAR: both halves of one tell the same, and noise grows with range."""
    with gzip.open(data / "rplidar_csv_rooms" / "mapping_keng.csv.gz", "rt") as file:
        rows = [row for row in csv.DictReader(file) if row["station"] == station]
    scans = []
    for _, samples in groupby(rows, key=lambda row: row["rev"]):
        mm, degrees = np.array([(row["distance_mm"], row["angle_deg"]) for row in samples], float).T
        scans.append(Scan(mm / 1e3, np.radians(-degrees)))
    halves = [calibrate(part) for part in (scans[: len(scans) // 2], scans[len(scans) // 2 :])]
    for half in halves:
        print(half)
        assert 2e-4 < half.sigma_range.value < 0.02
        assert half.by_range.sigmas[0].high < half.by_range.sigmas[2].low
        assert half.by_range.p_value < 1e-3
        assert half.outliers.value < 0.03
    near = [half.by_range.sigmas[0] for half in halves]
    assert max(i.low for i in near) < 2 * min(i.high for i in near)


def test_the_command_writes_a_noise_that_extraction_takes(data, tmp_path):
    """`lidarcore calibrate`, and its file as --settings."""
    recording, profile = data / "rplidar_csv_rooms" / "mapping_keng.csv.gz", tmp_path / "noise.json"
    arguments = ["calibrate", str(recording), "--skip", "5", "--scans", "100", "-o", str(profile)]
    result = CliRunner().invoke(cli, arguments, env={"COLUMNS": "120"})
    assert result.exit_code == 0, result.output
    for row in ("sigma_bearing, mrad", "sigma_range, mm", "range bias, mm", "alignment, °"):
        assert row in result.output
    assert "sensor's x axis" in result.output.replace("\n", " ")
    scans = list(islice(open_recording(recording), 5, 105))
    assert settings_from(profile, None).extraction.noise == calibrate(scans).noise


def test_the_command_writes_json(data):
    recording = data / "rplidar_csv_rooms" / "mapping_keng.csv.gz"
    result = CliRunner().invoke(cli, ["calibrate", str(recording), "--skip", "5", "--scans", "100", "--json"])
    assert result.exit_code == 0, result.output
    scans = list(islice(open_recording(recording), 5, 105))
    assert json.loads(result.output) == json.loads(to_json(calibration_json(calibrate(scans))))


def test_words_say_what_cannot_be_told():
    """A narrow view of one wall; then a plain room, with and without a bias."""
    world = World(np.array([[[2.0, -3.0], [2.0, 3.0]]]))
    sensor, rng = SimulatedSensor(world, SensorNoise(0.02, 0.001), beams=3600), np.random.default_rng(0)
    narrow = [sensor.scan(np.zeros(3), rng)[0] for _ in range(30)]
    narrow = [replace(s, ranges=np.where(np.abs(s.bearings) < 0.15, s.ranges, np.nan)) for s in narrow]
    bearing, bias, alignment = calibration_json(calibrate(narrow))["remarks"]
    assert "cannot be told from 0" in bearing
    assert "cannot be told" in bias
    assert "cannot be told" in alignment
    scans = standing(SensorNoise(0.005, 0.001), 8, rectangular_room(5, 4))
    bias, alignment = calibration_json(calibrate(scans))["remarks"]
    assert "No range bias is seen" in bias
    longer = [replace(scan, ranges=scan.ranges + 0.03) for scan in scans]
    assert "too long by" in calibration_json(calibrate(longer))["remarks"][0]
    shorter = [replace(scan, ranges=scan.ranges - 0.03) for scan in scans]
    assert "too short by" in calibration_json(calibrate(shorter))["remarks"][0]
