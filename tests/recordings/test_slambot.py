"""The SLAMbot's log: encoders of 16 bits, a clock of 16 bits, a range for each degree, clockwise."""

from pathlib import Path

import numpy as np
import pytest
from tick_logs import scans_of, way

from lidarcore import open_recording

TICK = 0.90 * np.pi * 58.2e-3 / (1000 / 3)
AHEAD = -0.035  # m, of the lidar


def line(left: int, right: int, milliseconds: int, ranges: dict[int, int] | None = None) -> str:
    row = [(ranges or {}).get(degree, 0) for degree in range(360)]
    return " ".join(map(str, [left, right, milliseconds, *row])) + "\n"


def test_angles_grow_clockwise_and_zero_is_no_return(tmp_path: Path) -> None:
    (scan,) = scans_of(tmp_path / "a.log", line(0, 0, 0, {0: 1000, 90: 2000}))
    np.testing.assert_allclose(scan.xy[scan.valid], [[1, 0], [0, -2]], atol=1e-12)


def test_the_lidar_turns_once_from_line_to_line_and_clockwise(tmp_path: Path) -> None:
    first, last = scans_of(tmp_path / "a.log", *(line(0, 0, 180 * k) for k in range(4)))[::3]
    for scan in (first, last):
        assert scan.beam_times is not None
        np.testing.assert_allclose(
            scan.beam_times, 0.18 * (-scan.bearings % (2 * np.pi)) / (2 * np.pi), atol=1e-9
        )


def test_equal_ticks_drive_straight_and_a_wrap_is_none(tmp_path: Path) -> None:
    rows = [line(32700, -32700, 0), line(-32736, -32600, 180)]  # both sides 100 on, the left one over the end
    np.testing.assert_allclose(way(scans_of(tmp_path / "a.log", *rows), AHEAD), [100 * TICK, 0, 0], atol=1e-9)


def test_more_ticks_on_the_right_turn_to_the_left(tmp_path: Path) -> None:
    end = way(scans_of(tmp_path / "a.log", line(0, 0, 0), line(-50, 50, 180)), AHEAD)
    np.testing.assert_allclose(end, [0, 0, 100 * TICK / 0.190], atol=1e-9)


def test_the_clock_wraps_and_goes_on(tmp_path: Path) -> None:
    rows = [line(0, 0, 65400), line(0, 0, 46), line(0, 0, 228)]
    np.testing.assert_allclose([s.stamp for s in scans_of(tmp_path / "a.log", *rows)], [65.4, 65.582, 65.764])


def test_over_a_reset_of_the_encoders_the_robot_stands(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    rows = [line(30000, 29000, 0), line(30100, 29100, 180), line(0, 0, 360), line(100, 100, 540)]
    np.testing.assert_allclose(way(scans_of(path, *rows), AHEAD), [200 * TICK, 0, 0], atol=1e-9)
    assert any("jumped 1 time" in note for note in open_recording(path).notes)


def test_a_truncated_line_is_left_out_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    rows = [line(0, 0, 0), line(7000, 7000, 90)[:400] + "\n", line(100, 100, 180)]
    scans = scans_of(path, *rows)
    assert [scan.stamp for scan in scans] == [0.0, 0.18]
    np.testing.assert_allclose(way(scans, AHEAD), [100 * TICK, 0, 0], atol=1e-9)
    recording = open_recording(path)
    list(recording)
    assert any("damaged" in note for note in recording.notes)


def test_the_real_log_drives_towards_a_wall_by_what_the_lidar_says(data: Path) -> None:
    """1.81 m straight ahead between scans 123 and 198; the tracks' slip is known to a few per cent."""
    scans = list(open_recording(data / "slambot_rplidar_a1_encoders" / "data_24JUL14_14m.log.gz"))
    assert (len(scans), scans[-1].stamp - scans[0].stamp) == (237, pytest.approx(43.431))
    x, y, heading = way(scans[123:199], AHEAD)
    assert abs(heading) < 0.05
    far, near = (np.nanmedian(scan.ranges[np.abs(scan.bearings) < 0.06]) for scan in (scans[123], scans[198]))
    np.testing.assert_allclose(np.hypot(x, y), far - near, rtol=0.06)
