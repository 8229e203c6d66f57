"""Calibration against simulated truth, and on stations where a real sensor stood still."""

import csv
import gzip
import json
from dataclasses import replace
from itertools import groupby, islice, pairwise

import numpy as np
import pytest
from chance import fewest
from lidarcore_app.cli.main import cli
from lidarcore_app.cli.options import settings_from
from lidarcore_app.jobs.calibration_report import report
from pydantic_core import to_json
from typer.testing import CliRunner

from lidarcore import ExtractionSettings, Scan, SensorNoise, extract, open_recording
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.calibration.calibrate import calibrate
from lidarcore.evaluation.calibration.renewal import resampling
from lidarcore.evaluation.calibration.unevenness import overlooked
from lidarcore.evaluation.calibration.variances import variance_model
from lidarcore.evaluation.intervals import Interval
from lidarcore.evaluation.stations.study import study
from lidarcore.geometry import wrap
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
    told = SensorNoise(result.sigma_range.value, result.sigma_bearing.value)
    usual = SensorNoise().unevenness_length
    found = replace(result.noise, unevenness=0.0, unevenness_length=usual, renewal=1.0, resampling=0.0)
    assert found == told
    assert result.noise.unevenness < 0.25 * noise.sigma_range  # the walls are straight
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
    assert (held >= fewest(repeats, 0.95)).all()  # intervals that hold 0.8 would be caught
    assert (held < repeats).all()  # as of endless ones; of those that hold 0.95 once in five million times


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


@pytest.mark.parametrize("direction", [[0.01, 0.0], [0.0, 0.01], [0.006, 0.008]])
def test_a_sensor_that_moves_along_walls_is_refused(direction):
    """Walls along its way stay where they are; those at its ends go with it."""
    sensor = SimulatedSensor(rectangular_room(4.5, 2.5), SensorNoise(0.005, 0.001))
    rng, pose = np.random.default_rng(0), np.array([0.2, 0.1, 0.4])
    moving = [sensor.scan(pose + np.array([*direction, 0.0]) * i, rng)[0] for i in range(30)]
    with pytest.raises(EvaluationError, match="stands still"):
        calibrate(moving)


def test_a_wall_that_moves_alone_is_left_out():
    """One wall of four goes away by 2 mm a scan, as a door does. Kept, it would have drifted by 80 mm."""
    noise = SensorNoise(0.005, 0.001)
    scans = standing(noise, 5, rectangular_room(4.5, 2.5))
    line = extract(scans[0], ExtractionSettings(noise=noise)).segments
    first, last = scans[0].bearings[[line.first_beam[1], line.last_beam[1]]]
    one = [(scan.bearings - first) % (2 * np.pi) < (last - first) % (2 * np.pi) for scan in scans]
    moving = [
        replace(scan, ranges=scan.ranges + 0.002 * i * on)
        for i, (scan, on) in enumerate(zip(scans, one, strict=True))
    ]
    result = calibrate(moving)
    assert result.walls >= 3
    assert_near(result.sigma_range, noise.sigma_range)
    assert result.drift < 0.03


@pytest.mark.parametrize(("creep", "expected"), [(0.0, 0.0), (0.02, 1.0), (0.37, 1.0)])
def test_bearings_that_creep_sample_all_of_the_wall_in_the_end(creep, expected):
    """By a share of the spacing from scan to scan: after fifty scans beams have been everywhere."""
    spacing = 2 * np.pi / 200
    bearings = [np.sort(wrap(spacing * (np.arange(200) + creep * i))) for i in range(100)]
    found = resampling([Scan(np.ones(200), at) for at in bearings])
    assert abs(found - expected) < 0.15


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


def narrow_view():
    """Of one wall, square to the beams: what a bearing error does cannot be seen."""
    world = World(np.array([[[2.0, -3.0], [2.0, 3.0]]]))
    sensor, rng = SimulatedSensor(world, SensorNoise(0.02, 0.001), beams=3600), np.random.default_rng(0)
    scans = [sensor.scan(np.zeros(3), rng)[0] for _ in range(30)]
    return [replace(s, ranges=np.where(np.abs(s.bearings) < 0.15, s.ranges, np.nan)) for s in scans]


def test_a_noise_that_cannot_be_told_is_not_made_up():
    """The interval of sigma_bearing reaches down to 0: what is set stays, or the default."""
    result = calibrate(narrow_view())
    assert_near(result.sigma_range, 0.02)
    assert result.sigma_bearing.low == 0
    assert result.told["sigma_range"] == result.sigma_range.value
    assert result.told["sigma_bearing"] is None
    assert result.noise.sigma_range == result.sigma_range.value
    most = result.sigma_bearing.high
    assert result.noise.sigma_bearing == min(SensorNoise().sigma_bearing, most)
    assert result.noise_or(SensorNoise(0.5, 0.0042)).sigma_bearing == min(0.0042, most)
    assert report(result).noise.sigma_bearing is None


@pytest.mark.long
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
    assert_white_noise_is_a_part_of_the_scatter(calibrate(scans), scans)
    halves = [calibrate(part) for part in (scans[: len(scans) // 2], scans[len(scans) // 2 :])]
    for half in halves:
        print(half)
        assert half.by_range.sigmas[0].value < half.by_range.sigmas[2].value
        assert half.by_range.p_value < 0.01
        assert half.range_growth.low > 0
        assert half.outliers.value < 0.03
    near = [half.by_range.sigmas[0] for half in halves]
    assert max(i.low for i in near) < 2 * min(i.high for i in near)


def assert_white_noise_is_a_part_of_the_scatter(result, scans):
    """Where beams meet walls squarely, bearings do not matter: in the nearest band that has several, by 3 sigma.

    The rest is the wall's pattern, which other bearings sample anew in every revolution.
    """
    edges, square = result.by_range.edges, list(square_beams(scans))
    inside = [[v for r, v in square if low <= r < high] for low, high in pairwise(edges)]
    sigma, variances = next(
        (sigma, np.array(v)) for sigma, v in zip(result.by_range.sigmas, inside, strict=True) if len(v) >= 5
    )
    error = variances.std(ddof=1) / np.sqrt(len(variances))
    print(f"{1e3 * sigma.value:.2f} mm, by numpy {1e3 * np.sqrt(variances.mean()):.2f} mm")
    assert error < 0.3 * variances.mean()
    known = (sigma.high**2 - sigma.low**2) / 4
    assert sigma.value**2 - variances.mean() < 3 * np.hypot(error, known)


def square_beams(scans):
    """Range and variance of ranges in each degree where a straight wall is met squarely: 1 / range is a cosine."""
    ranges = np.concatenate([scan.ranges for scan in scans])
    degree = np.degrees(np.concatenate([scan.bearings for scan in scans])).astype(int) % 360
    seen = np.isfinite(ranges) & (ranges > 0)
    inside = [ranges[seen & (degree == d)] for d in range(360)]
    medians = np.array([np.median(r) if len(r) >= 30 else np.nan for r in inside])
    offsets = np.arange(-4, 5)
    A = np.column_stack([np.cos(np.radians(offsets)), np.sin(np.radians(offsets))])
    for d in range(360):
        around = medians[(d + offsets) % 360]
        if not np.isfinite(around).all():
            continue
        cosine, sine = np.linalg.lstsq(A, 1 / around)[0]
        straight = np.abs(1 / (A @ [cosine, sine]) - around).max() < 0.01
        if straight and abs(sine / cosine) < 0.1:
            off = np.abs(inside[d] - medians[d])
            yield medians[d], inside[d][off <= 6 * 1.4826 * max(np.median(off), 1e-4)].var(ddof=1)


def test_the_command_writes_a_noise_that_extraction_takes(data, tmp_path):
    """`lidarcore calibrate`, and its file as --settings."""
    recording, profile = data / "rplidar_csv_rooms" / "mapping_keng.csv.gz", tmp_path / "noise.json"
    arguments = ["calibrate", str(recording), "--skip", "5", "--scans", "100", "-o", str(profile)]
    result = CliRunner().invoke(cli, arguments, env={"COLUMNS": "120"})
    assert result.exit_code == 0, result.output
    for row in (
        "sigma_bearing, mrad",
        "sigma_range, mm",
        "unevenness_length, mm",
        "resampling",
        "alignment, °",
    ):
        assert row in result.output
    assert "sensor's x axis" in result.output.replace("\n", " ")
    scans = list(islice(open_recording(recording), 5, 105))
    assert settings_from(profile, None).extraction.noise == calibrate(scans).noise


@pytest.mark.parametrize("arguments", [[], ["--settings"]], ids=["the default", "settings"])
def test_the_command_keeps_what_cannot_be_told(tmp_path, arguments):
    recording, profile = save(narrow_view(), tmp_path / "narrow.npz"), tmp_path / "noise.json"
    kept = SensorNoise()
    if arguments:
        kept = SensorNoise(0.5, 0.0042)
        settings = tmp_path / "settings.json"
        settings.write_text('{"extraction": {"noise": {"sigma_range": 0.5, "sigma_bearing": 0.0042}}}')
        arguments = [*arguments, str(settings)]
    result = CliRunner().invoke(cli, ["calibrate", str(recording), "-o", str(profile), *arguments])
    assert result.exit_code == 0, result.output
    words = " ".join(result.output.split())
    assert "unknown" in words
    expected = calibrate(narrow_view()).noise_or(kept)
    assert f"keeps sigma_bearing {1e3 * expected.sigma_bearing:g} mrad" in words
    assert settings_from(profile, None).extraction.noise == expected


@pytest.mark.real_data
def test_no_bearing_noise_is_made_of_uneven_walls(data):
    """In golf_room the pattern of walls once passed for 5 mrad; differences of neighbouring beams know better."""
    scans = list(islice(open_recording(data / "rplidar_csv_rooms" / "golf_room.csv.gz"), 200))
    found = calibrate(scans)
    assert found.sigma_bearing.high < 0.002
    assert found.sigma_range.high < 0.002


@pytest.mark.parametrize(
    ("output", "said"),
    [("nosuch/x.json", "is not a file in a folder that exists"), ("x.txt", "should end in .json")],
)
def test_the_command_refuses_an_output_before_it_reads(tmp_path, output, said):
    """The recording is not there either, and would be told of next."""
    result = CliRunner().invoke(
        cli, ["calibrate", str(tmp_path / "missing.npz"), "-o", str(tmp_path / output)]
    )
    assert result.exit_code != 0
    assert said in str(result.exception) + result.output
    assert list(tmp_path.iterdir()) == []


def save(scans, path):
    arrays = {name: np.array([getattr(scan, name) for scan in scans]) for name in ("ranges", "bearings")}
    np.savez(path, **arrays, stamps=100 + 0.1 * np.arange(len(scans)))
    return path


def test_the_command_writes_json(data):
    recording = data / "rplidar_csv_rooms" / "mapping_keng.csv.gz"
    result = CliRunner().invoke(cli, ["calibrate", str(recording), "--skip", "5", "--scans", "100", "--json"])
    assert result.exit_code == 0, result.output
    scans = list(islice(open_recording(recording), 5, 105))
    assert json.loads(result.output) == json.loads(to_json(report(calibrate(scans))))


@pytest.mark.parametrize("most", [0.0005, 0.002, 0.008, 0.1])
def test_where_walls_may_be_straight_half_of_such_rooms_are_less_uneven_than_is_assumed(most):
    """Rooms drawn with sizes about 4 mm, by a factor of 2, of which those remain that could have been overlooked.

    The share is 0.5 ± 0.008 at least (4,000 rooms remain); five of these are allowed.
    """
    rooms = 0.004 * np.exp(np.log(2) * np.random.default_rng(0).standard_normal(4_000_000))
    overlooked_rooms = rooms[rooms <= most]
    size, length = overlooked(Interval(0.0, 0.0, most))
    assert np.mean(overlooked_rooms < size) == pytest.approx(0.5, abs=0.04)
    assert length == 0.10


def test_where_no_wall_was_seen_nothing_is_assumed():
    assert overlooked(Interval(0.0, 0.0, 0.0))[0] < 1e-6


@pytest.mark.real_data
def test_what_fifty_scans_overlook_of_the_walls_does_not_make_ellipses_collapse(data):
    """In this hundred of a room the walls of the first fifty scans may as well be straight: taken for straight,
    the ellipses of the other fifty held .24 of how walls scatter."""
    scans = list(islice(open_recording(data / "rplidar_csv_rooms" / "golf_room.csv.gz"), 700, 800))
    assert calibrate(scans[:50]).unevenness.low == 0
    walls = study([("golf room", scans)], ("ml",)).walls
    assert walls.coverage(0).value > 0.8


@pytest.mark.long
def test_words_say_what_cannot_be_told():
    """A narrow view of one wall; then a plain room, with and without a bias."""
    found = calibrate(narrow_view())
    bearing, straight, bias, alignment = report(found).remarks
    assert "may as well be straight" in straight
    assert f"{1e3 * found.noise.unevenness:.1f} mm are assumed" in straight
    assert "The bearing noise cannot be determined here (at most" in bearing
    assert "cannot be determined" in bias
    assert "cannot be determined" in alignment
    scans = standing(SensorNoise(0.005, 0.001), 8, rectangular_room(5, 4))
    assert any("No range bias is detected" in remark for remark in report(calibrate(scans)).remarks)
    longer = [replace(scan, ranges=scan.ranges + 0.03) for scan in scans]
    assert any("too long by" in remark for remark in report(calibrate(longer)).remarks)
    shorter = [replace(scan, ranges=scan.ranges - 0.03) for scan in scans]
    assert any("too short by" in remark for remark in report(calibrate(shorter)).remarks)


def test_a_bias_known_to_a_decimetre_only_is_no_figure():
    result = calibrate(standing(SensorNoise(0.005, 0.001), 8, rectangular_room(5, 4)))
    known = report(result)
    assert known.range_bias.value == result.range_bias.value
    vague = report(replace(result, range_bias=Interval(-0.85, -1.99, 0.287)))
    assert vague.range_bias is None
    assert any("range bias cannot be determined" in remark for remark in vague.remarks)


def remarks(scans):
    return " ".join(report(calibrate(scans)).remarks)


def rougher(scans, sigma):
    """With more noise in the ranges, as the function of a scan has it (m)."""
    rng = np.random.default_rng(0)
    return [
        replace(scan, ranges=scan.ranges + rng.normal(0, 1, len(scan)) * sigma(scan.ranges)) for scan in scans
    ]


def test_words_say_where_one_number_fits_badly():
    scans = standing(SensorNoise(0.005, 0.001), 2)
    said = remarks(scans)
    assert "Range noise" not in said
    assert "drifted" not in said
    growing = calibrate(rougher(scans, lambda ranges: 0.001 * ranges**2))
    assert growing.by_range.p_value < 0.01
    assert not any("Range noise" in remark for remark in report(growing).remarks)  # the growth explains it
    sigma_range, growth, sigma_bearing = growing.on_smooth_walls
    constant = replace(growing, on_smooth_walls=(sigma_range, Interval(0, 0, growth.high), sigma_bearing))
    grows = " ".join(report(constant).remarks)
    assert (
        "grows with distance: one number fits badly; ellipses of corners far away will be too small" in grows
    )
    beyond = remarks(rougher(scans, lambda ranges: 0.0001 * np.exp(ranges)))
    assert "differs with distance: sigma_range and range_growth fit badly" in beyond
    falls = remarks(rougher(scans, lambda ranges: 0.02 / ranges))
    assert "falls with distance: one number fits badly; ellipses of corners nearby will be too small" in falls


def test_words_say_that_something_moved():
    scans = standing(SensorNoise(0.005, 0.001), 5)
    moved = [replace(scan, ranges=scan.ranges + 0.0003 * i) for i, scan in enumerate(scans)]
    assert "A wall drifted by more than the noise, by 1" in remarks(moved)
