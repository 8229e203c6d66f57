"""Logs of CoreSLAM: 25 columns, among them encoders, two spaces, 682 ranges of a Hokuyo URG-04LX."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tick_logs import scans_of, way

from lidarcore import open_recording
from lidarcore.geometry import PoseTrack, relative
from lidarcore.mapping import Mapper

TICK = 2 * np.pi * 0.077 / 2000
AHEAD = 0.145  # m, of the lidar
MINES = "breezyslam_mines_urg/exp2.dat.gz"


def line(seconds: float, left: int, right: int, ranges: dict[int, int] | None = None) -> str:
    row = [(ranges or {}).get(k, 0) for k in range(682)]
    before = [int(1e6 * seconds), 14554, left, right, "1.38785", 0, 0, "167.2", *17 * [0]]
    return f"{' '.join(map(str, before))}  {' '.join(map(str, row))}\n"


def test_beams_run_from_the_right_to_the_left_in_the_steps_of_the_sensor(tmp_path: Path) -> None:
    """1024 steps a turn; step 384 looks ahead, the first one is 44. Up to 19 mm is a code for an error."""
    (scan,) = scans_of(
        tmp_path / "a.dat", line(3.5, 0, 0, {340: 1000, 340 - 256: 2000, 340 + 256: 500, 9: 16})
    )
    np.testing.assert_allclose(scan.xy[scan.valid], [[0, -2], [1, 0], [0, 0.5]], atol=1e-12)
    assert scan.stamp == 3.5
    assert len(scan) == 682


def test_encoders_tell_the_way(tmp_path: Path) -> None:
    ahead = way(scans_of(tmp_path / "a.dat", line(0, 500, 700), line(1, 1500, 1700)), AHEAD)
    np.testing.assert_allclose(ahead, [1000 * TICK, 0, 0], atol=1e-9)
    turned = way(scans_of(tmp_path / "b.dat", line(0, 0, 0), line(1, -200, 200)), AHEAD)
    np.testing.assert_allclose(turned, [0, 0, 400 * TICK / 0.33], atol=1e-9)


def test_over_a_reset_of_the_encoders_the_robot_stands(tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    rows = [line(0, 300000, 290000), line(1, 300100, 290100), line(2, 0, 0), line(3, 100, 100)]
    np.testing.assert_allclose(way(scans_of(path, *rows), AHEAD), [200 * TICK, 0, 0], atol=1e-9)
    assert any("jumped 1 time" in note for note in open_recording(path).notes)


def test_a_line_that_was_held_up_is_no_jump(tmp_path: Path) -> None:
    rows = [
        line(seconds, ticks, ticks)
        for seconds, ticks in ((0, 0), (0.199, 200), (0.2, 400), (0.3, 600), (0.4, 800))
    ]
    np.testing.assert_allclose(way(scans_of(tmp_path / "a.dat", *rows), AHEAD), [800 * TICK, 0, 0], atol=1e-9)


def test_beams_are_taken_one_after_the_other_within_the_time_from_line_to_line(tmp_path: Path) -> None:
    first, last = scans_of(tmp_path / "a.dat", *(line(0.1 * k, 0, 0) for k in range(4)))[::3]
    for scan in (first, last):
        assert scan.beam_times is not None
        np.testing.assert_allclose(scan.beam_times, 0.1 * np.arange(682) / 1024)


def test_a_line_that_is_cut_is_left_out_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    scans = scans_of(path, line(0, 0, 0), line(1, 0, 0)[:900] + "\n", line(2, 0, 0))
    assert [scan.stamp for scan in scans] == [0, 2]
    recording = open_recording(path)
    list(recording)
    assert "1 damaged line left out." in recording.notes


@pytest.mark.real_data
def test_encoders_and_scans_of_the_real_log_tell_the_same_turns(data: Path) -> None:
    """By whole scans alone, which know nothing of encoders. A line is written a revolution after its scan was taken."""
    scans = list(open_recording(data / MINES))
    assert (len(scans), round(scans[-1].stamp - scans[0].stamp, 1)) == (641, 63.2)
    assert not open_recording(data / MINES).notes
    mapper = Mapper()
    for scan in scans[:300]:
        mapper.step(replace(scan, odometry=None))
    found = mapper.trajectory()[1]
    track = PoseTrack(np.array([scan.stamp for scan in scans]), np.array([scan.odometry for scan in scans]))
    before = [max(scan.stamp - 0.2, scans[0].stamp) for scan in scans[:300]]
    driven = relative(scans[0].odometry, np.array([track.at(stamp) for stamp in before]))
    turns, seen = (np.diff(np.unwrap(poses[:, 2])[::10]) for poses in (driven, found))
    assert np.ptp(np.cumsum(turns)) > 1.0
    assert np.corrcoef(turns, seen)[0, 1] > 0.99
    steps, matched = (relative(poses[:-10:10], poses[10::10])[:, 0] for poses in (driven, found))
    assert np.corrcoef(steps, matched)[0, 1] > 0.99
