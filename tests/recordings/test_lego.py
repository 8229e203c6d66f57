"""The LEGO robot's log: scans in one file, encoders beside it or among them."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from lidarcore import ExtractionSettings, Scan, SensorNoise, extract, open_recording
from lidarcore.geometry import compose, inverse

FOLDER = "brenner_lego_arena_groundtruth"


def scan_line(milliseconds: int) -> str:
    return f"S {milliseconds} 660 " + " ".join(str(1000 + i) if i != 330 else "15" for i in range(660)) + "\n"


def motor_line(milliseconds: int, left: int, right: int) -> str:
    return f"M {milliseconds} {left} {left} 3000 0 {right} {right} 3000 0 0 0 6000 0\n"


def test_dead_reckoning_of_the_real_log_ends_as_far_off_as_others_found(data: Path) -> None:
    scans = list(open_recording(data / FOLDER / "robot4_scan.txt"))
    reference = np.loadtxt(data / FOLDER / "robot4_reference.txt", usecols=(1, 2, 3)) / 1000
    first, last = (scan.odometry for scan in (scans[0], scans[-1]))
    assert len(scans) == 278
    assert first is not None
    assert last is not None
    end = compose(np.array([1.850, 1.897, np.deg2rad(213)]), compose(inverse(first), last))
    np.testing.assert_allclose(np.hypot(*(end[:2] - reference[-1, 1:])), 1.050, atol=0.002)


def test_bearings_stamps_and_error_codes(tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text(scan_line(500) + scan_line(700))
    recording = open_recording(path)
    scan = next(iter(recording))
    steps = np.array([0, 30, 32, 340, 680])  # the recorder lost 31, 63, ...
    np.testing.assert_allclose(
        scan.bearings[[0, 30, 31, 330, 659]], 2 * np.pi / 1024 * (steps - 340) - 0.06981317
    )
    assert (scan.stamp, scan.ranges[0], scan.ranges[659]) == (0.5, 1.0, 1.659)
    assert np.flatnonzero(~scan.valid).tolist() == [330]
    assert scan.odometry is None
    assert any("no odometry" in note for note in recording.notes)


def test_encoders_among_the_scans_turn_the_robot_along_an_arc(tmp_path: Path) -> None:
    """One track stands, the other goes 1000 ticks: the scanner, 30 mm ahead, turns about the standing track."""
    path = tmp_path / "run.txt"
    path.write_text(scan_line(0) + motor_line(0, 65000, 7) + scan_line(1000) + motor_line(1000, 65000, 1007))
    first, last = (scan.odometry for scan in open_recording(path))
    turn = 0.349 / 0.155
    standing = np.array([0.0, 0.155 / 2])
    c, s = np.cos(turn), np.sin(turn)
    expected = standing + np.array([[c, -s], [s, c]]) @ (np.array([0.030, 0.0]) - standing)
    np.testing.assert_allclose(first, [0.030, 0, 0], atol=1e-12)
    np.testing.assert_allclose(last, [*expected, turn], atol=1e-9)


def test_a_scan_long_after_the_last_encoder_has_no_odometry(tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text(
        motor_line(0, 0, 0) + scan_line(10) + scan_line(400) + scan_line(9000) + motor_line(300, 9, 9)
    )
    assert [scan.odometry is None for scan in open_recording(path)] == [False, False, True]


def test_truth_is_the_position_of_the_reference_at_the_stamp(tmp_path: Path) -> None:
    path = tmp_path / "run_scan.txt"
    path.write_text(scan_line(50) + scan_line(150) + scan_line(250))
    (tmp_path / "run_reference.txt").write_text("P 100 1000 -200\nP oops\nP 200 2000 -400\n")
    recording = open_recording(path)
    before, between, after = recording
    assert before.truth is None
    assert after.truth is None
    np.testing.assert_allclose(between.truth, [1.5, -0.3, np.nan])
    assert any("Damaged lines of run_reference.txt" in note for note in recording.notes)


def test_long_walls_of_the_square_arena_are_at_right_angles(data: Path) -> None:
    """With the lost values in mind; as if the beams were evenly spaced, they are twice as far from it."""
    scans = list(open_recording(data / FOLDER / "robot4_scan.txt"))
    even = 2 * np.pi / 1024 * (np.arange(660) - 330)
    assert skew(scans) < 0.6 * skew([replace(scan, bearings=even) for scan in scans])


def skew(scans: list[Scan]) -> float:
    """rad, median deviation of a scan's walls from the directions, a right angle apart, that suit them best."""
    settings, deviations = ExtractionSettings(noise=SensorNoise(0.015, 0.004)), []
    for scan in scans:
        segments = extract(scan, settings).segments
        along = (segments.end - segments.start)[segments.length > 0.4]
        fourfold = np.exp(4j * np.arctan2(along[:, 1], along[:, 0]))
        if len(along) > 1:
            deviations.append(np.angle(fourfold / fourfold.sum()) / 4)
    return float(np.median(np.abs(np.concatenate(deviations))))
