"""What RecordingWriter writes, read back by this project: nothing is lost."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from recorded_scans import KINDS, UNIX, assert_same, clockwise, demo, half_view

from lidarcore import Scan, extract, open_recording
from lidarcore.errors import RecordingError
from lidarcore.recordings.writer import RecordingWriter


def written(path, *scans):
    with RecordingWriter(path) as recording:
        for scan in scans:
            recording.write(scan)
    return open_recording(path)


@pytest.mark.parametrize("kind", KINDS)
def test_a_scan_is_read_back_as_it_was_written(tmp_path, kind):
    recording = written(tmp_path / "a.mcap", KINDS[kind])
    (scan,) = recording
    assert_same(scan, KINDS[kind])
    assert recording.notes == ()


def test_a_run_is_read_back_in_order(tmp_path):
    scans = demo(50)
    recording = written(tmp_path / "a.mcap", *scans)
    for read, scan in zip(recording, scans, strict=True):
        assert_same(read, scan)
    assert recording.topic == "/scan"
    assert recording.notes == ()


def test_features_beside_the_scans_do_not_disturb_reading(tmp_path):
    scans = demo(5)
    with RecordingWriter(tmp_path / "a.mcap") as recording:
        for scan in scans:
            recording.write(scan, extract(scan))
    for read, scan in zip(open_recording(tmp_path / "a.mcap"), scans, strict=True):
        assert_same(read, scan)


def test_poses_of_a_drive_come_back(tmp_path):
    poses = [(0.1 * k, -0.05 * k, 3.0 + 0.1 * k) for k in range(20)]
    scans = [replace(half_view(odometry=pose), stamp=UNIX + 0.1 * k) for k, pose in enumerate(poses)]
    recording = written(tmp_path / "a.mcap", *scans)
    for scan, (x, y, heading) in zip(recording, poses, strict=True):
        assert scan.odometry[:2] == pytest.approx([x, y], abs=1e-12)
        assert np.remainder(scan.odometry[2] - heading + 1, 2 * np.pi) == pytest.approx(1, abs=1e-12)
    assert recording.notes == ()


floats = st.floats(width=32) | st.floats(0.0625, 100, width=32)


@st.composite
def scans(draw):
    n = draw(st.integers(1, 40))
    start, step = draw(st.floats(-6, 6)), draw(st.floats(0, 2 * np.pi / n))
    bearings = start + step * np.sort(draw(arrays(float, n, elements=st.floats(0, n - 0.5))))
    bearings = (bearings + np.pi) % (2 * np.pi) - np.pi if draw(st.booleans()) else bearings
    rows = [draw(st.none() | arrays(float, n, elements=floats)) for _ in range(2)]
    gaps = draw(arrays(float, (draw(st.integers(0, 4)), 2), elements=st.floats(-7, 7)))
    stamp = draw(st.integers(1, 2**31 - 1)) + draw(st.integers(0, 999)) / 1000
    return Scan(draw(arrays(float, n, elements=floats)), bearings, stamp, *rows, gaps=gaps)


@given(scans())
@settings(max_examples=150)
def test_any_scan_is_read_back_as_it_was_written(tmp_path_factory, scan):
    (read,) = written(tmp_path_factory.mktemp("any") / "a.mcap", scan)
    assert_same(read, scan)


@pytest.mark.parametrize("stamps", [[0, 0, 0, 0], [5, 5, 5, 5], [9, 8, 7, 6], [1, 2, 1.5, 3]])
def test_stamps_that_do_not_grow_are_kept_and_time_goes_on(tmp_path, stamps):
    scans = [replace(clockwise(), stamp=float(stamp)) for stamp in stamps]
    with RecordingWriter(tmp_path / "a.mcap") as recording:
        for scan in scans:
            before = recording.duration
            recording.write(scan)
            assert recording.duration > before or recording.scans == 1
    read = list(open_recording(tmp_path / "a.mcap"))
    assert len(read) == 4
    if any(stamps):
        assert [scan.stamp for scan in read] == stamps
    else:  # unknown: the time of recording
        assert [scan.stamp for scan in read] == pytest.approx([0, 0.1, 0.2, 0.3])


def test_counts_are_those_of_the_file(tmp_path):
    with RecordingWriter(tmp_path / "a.mcap") as recording:
        for scan in demo(21):
            recording.write(scan)
        recording.flush()
        assert recording.size == (tmp_path / "a.mcap").stat().st_size > 0
    assert recording.scans == 21
    assert recording.duration == pytest.approx(2.0)
    assert recording.size == (tmp_path / "a.mcap").stat().st_size


def test_what_was_flushed_can_be_read_while_it_grows(tmp_path):
    scans = demo(5)
    with RecordingWriter(tmp_path / "a.mcap") as recording:
        for count, scan in enumerate(scans, 1):
            recording.write(scan)
            recording.flush()
            assert len(list(open_recording(tmp_path / "a.mcap"))) == count


def test_an_existing_file_is_refused_and_kept(tmp_path):
    (tmp_path / "a.mcap").write_text("precious")
    with pytest.raises(RecordingError, match=r"a\.mcap exists already: give the recording another name"):
        RecordingWriter(tmp_path / "a.mcap")
    assert (tmp_path / "a.mcap").read_text() == "precious"


@pytest.mark.parametrize("path", ["missing/a.mcap", "file/a.mcap", "a\0.mcap", "x" * 300])
def test_a_path_that_cannot_be_is_refused(tmp_path, path):
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match="cannot be created"):
        RecordingWriter(tmp_path / path)


def test_a_recording_without_a_scan_leaves_no_file(tmp_path):
    with RecordingWriter(tmp_path / "a.mcap") as recording:
        recording.flush()
    assert not (tmp_path / "a.mcap").exists()


def test_a_closed_recording_takes_nothing_more(tmp_path):
    with RecordingWriter(tmp_path / "a.mcap") as recording:
        recording.write(clockwise())
    with pytest.raises(RecordingError, match="is closed"):
        recording.write(clockwise())
    recording.close()
    assert len(list(open_recording(tmp_path / "a.mcap"))) == 1


def test_a_stamp_beyond_ros_is_refused_and_the_rest_is_kept(tmp_path):
    with RecordingWriter(tmp_path / "a.mcap") as recording:
        recording.write(clockwise())
        with pytest.raises(RecordingError, match="32 bits"):
            recording.write(replace(clockwise(), stamp=1e10))
        recording.write(replace(clockwise(), stamp=UNIX + 1))
    assert [scan.stamp for scan in open_recording(tmp_path / "a.mcap")] == [UNIX, UNIX + 1]


def test_an_exception_of_the_caller_leaves_a_whole_recording(tmp_path):
    def fail():
        with RecordingWriter(tmp_path / "a.mcap") as recording:
            recording.write(clockwise())
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    recording = open_recording(tmp_path / "a.mcap")
    assert len(list(recording)) == 1
    assert recording.notes == ()
