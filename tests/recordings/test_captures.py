"""Captures of the serial line: written and read back to the byte, and decoded as the driver decoded them."""

import io
import subprocess
import sys
import textwrap
import time
from itertools import islice

import numpy as np
import pytest
from captures import read_capture
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded_scans import dense_stream

from lidarcore import open_recording
from lidarcore.errors import RecordingError
from lidarcore.rplidar.capture import CaptureWriter, Stream, read_pieces, read_stream
from lidarcore.rplidar.driver import Driver
from lidarcore.rplidar.emulator_process import EmulatorProcess
from lidarcore.rplidar.listener import Listener
from lidarcore.rplidar.protocol import (
    Answer,
    Command,
    Descriptor,
    DeviceInfo,
    StreamDecoder,
    encode_nodes,
    request,
)

DENSE = Descriptor(Answer.DENSE, 84, repeated=True).encode()
pieces = st.lists(
    st.tuples(st.sampled_from(["in", "out"]), st.floats(0, 2e9), st.binary(max_size=300)), max_size=20
)


def ranges_of(revolutions):
    return [revolution.distances.tolist() for revolution in revolutions]


def decoded(stream):
    decoder = StreamDecoder(Answer.DENSE, 108.0)
    return ranges_of(turn for capsule, time in stream for turn in decoder.feed(capsule, time))


@given(pieces)
@settings(max_examples=50)
def test_what_was_captured_is_read_back_to_the_byte(tmp_path_factory, pieces):
    path = tmp_path_factory.mktemp("capture") / "a.rplidar"
    with CaptureWriter(path, Stream(0x85, 108.0, 115200)) as capture:
        for piece in pieces:
            capture.write(*piece)
        if pieces:
            assert list(read_capture(path)) == pieces  # while it is open, too
            assert capture.size == path.stat().st_size
    assert path.exists() == bool(pieces)


@given(pieces, st.data())
@settings(max_examples=50)
def test_a_capture_cut_anywhere_keeps_every_whole_record(tmp_path_factory, pieces, data):
    path = tmp_path_factory.mktemp("capture") / "a.rplidar"
    ends = []
    with CaptureWriter(path) as capture:
        for piece in [("in", 0.0, b"first"), *pieces]:
            capture.write(*piece)
            ends.append(capture.size)
    cut = data.draw(st.integers(ends[0], ends[-1]))
    stream, remarks = io.BytesIO(path.read_bytes()[:cut]), []
    read_stream(stream)
    read = list(read_pieces(stream, remarks.append))
    assert len(read) == sum(end <= cut for end in ends)
    assert bool(remarks) == (cut not in ends)


def test_a_capture_survives_the_end_of_its_process(tmp_path):
    program = """
        import os, sys
        from lidarcore.rplidar.capture import CaptureWriter
        capture = CaptureWriter(sys.argv[1])
        for k in range(1000):
            capture.write("in", float(k), bytes(84))
        os.kill(os.getpid(), 9)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program), tmp_path / "a.rplidar"], timeout=60
    )
    assert done.returncode == -9
    assert list(read_capture(tmp_path / "a.rplidar")) == [("in", float(k), bytes(84)) for k in range(1000)]


@pytest.mark.parametrize(
    "content", [b"", b"[1]\n", b'{"rplidar_capture": 2}\n', b'{"rplidar_capture": 1, "x": 0}\n']
)
def test_other_files_are_no_captures(tmp_path, content):
    (tmp_path / "a").write_bytes(content)
    with pytest.raises(RecordingError, match=r"not a capture|another version"):
        list(read_capture(tmp_path / "a"))


def test_an_existing_file_is_refused(tmp_path):
    (tmp_path / "a").write_text("precious")
    with pytest.raises(RecordingError, match="exists already"):
        CaptureWriter(tmp_path / "a")
    assert (tmp_path / "a").read_text() == "precious"


@given(st.lists(st.integers(1, 200), min_size=1))
@settings(max_examples=30)
def test_a_scan_is_found_behind_its_descriptor_in_any_fragments(sizes):
    data = DeviceInfo(0x61, (1, 28), 18, 16 * "00").encode() + DENSE + b"".join(c for c, _ in dense_stream())
    listener, at, found = Listener(), 0, []
    while at < len(data):
        size = sizes[at % len(sizes)]
        found += listener.received(data[at : at + size], 0.0)
        at += size
    assert ranges_of(found) == decoded((capsule, 0.0) for capsule, _ in dense_stream())
    assert not listener.close()


def test_every_new_scan_is_decoded_by_itself():
    """A reconnection: what is left of the old scan and the new one do not mix."""
    listener, found = Listener(), []
    for first in (0, 1):
        listener.sent(request(Command.STOP))
        found += listener.received(bytes(500), 0.0)  # after a STOP nothing is a measurement
        listener.sent(request(Command.EXPRESS_SCAN, bytes([1, 0, 0, 0, 0])))
        found += listener.received(DENSE, 0.0)
        for capsule, _ in dense_stream(first=first):
            found += listener.received(capsule, 0.0)
        listener.sent(request(Command.MOTOR_SPEED, b"\x58\x02"))  # which does not end it
        found += listener.received(b"", 0.0)
    expected = [decoded((capsule, 0.0) for capsule, _ in dense_stream(first=first)) for first in (0, 1)]
    assert ranges_of(found) == expected[0] + expected[1]
    assert not listener.close()


def test_a_capture_that_begins_in_a_scan_is_decoded_by_its_first_line(tmp_path):
    with CaptureWriter(tmp_path / "a.rplidar", Stream(Answer.DENSE, 108.0)) as capture:
        for capsule, time in dense_stream():
            capture.write("in", 1.7e9 + time, capsule)
    recording = open_recording(tmp_path / "a.rplidar")
    scans = list(recording)
    assert [(4000 * np.nan_to_num(scan.ranges[::-1])).round().tolist() for scan in scans] == decoded(
        dense_stream()
    )
    np.testing.assert_allclose(np.diff([scan.stamp for scan in scans]), 0.1, atol=1e-3)
    assert scans[0].stamp == pytest.approx(1.7e9, abs=0.2)


def test_a_capture_without_measurements_is_refused(tmp_path):
    with CaptureWriter(tmp_path / "a.rplidar") as capture:
        capture.write("in", 1.0, bytes(1000))
    with pytest.raises(RecordingError, match="no readable scan"):
        list(open_recording(tmp_path / "a.rplidar"))


def test_a_clock_that_was_set_back_does_not_stop_reading(tmp_path):
    with CaptureWriter(tmp_path / "a.rplidar", Stream(Answer.DENSE, 108.0)) as capture:
        for number, (capsule, time) in enumerate(dense_stream()):
            capture.write("in", 1.7e9 + time - 3600 * (number > 60), capsule)
    assert len(list(open_recording(tmp_path / "a.rplidar"))) == len(decoded(dense_stream()))


def test_a_damaged_capture_is_read_up_to_the_damage(tmp_path):
    ends = []
    with CaptureWriter(tmp_path / "a.rplidar", Stream(Answer.DENSE, 108.0)) as capture:
        for capsule, time_ in dense_stream():
            capture.write("in", time_, capsule)
            ends.append(capture.size)
    content = bytearray((tmp_path / "a.rplidar").read_bytes())
    content[ends[70]] ^= 0xFF
    (tmp_path / "b.rplidar").write_bytes(content)
    recording = open_recording(tmp_path / "b.rplidar")
    assert len(list(recording)) == len(decoded(list(dense_stream())[:71]))
    assert "The capture is damaged or cut short: everything before is read." in recording.notes


@pytest.mark.long
def test_a_live_capture_holds_what_the_driver_gave(tmp_path):
    with (
        CaptureWriter(tmp_path / "a.rplidar") as capture,
        EmulatorProcess() as emulator,
        Driver(emulator.port, tap=capture.write) as driver,
    ):
        live = list(islice(driver, 8))
    read = list(open_recording(tmp_path / "a.rplidar"))[: len(live)]
    for scan, seen in zip(read, live, strict=True):
        np.testing.assert_array_equal(scan.ranges, seen.ranges)
        np.testing.assert_allclose(scan.bearings, seen.bearings)
        np.testing.assert_allclose(scan.beam_times, seen.beam_times, atol=1e-6)
        assert scan.stamp == pytest.approx(seen.stamp, abs=0.01)
        assert abs(scan.stamp - time.time()) < 60


@pytest.mark.long
@pytest.mark.parametrize(
    ("sensor", "wish", "name"),
    [({}, "Standard", "Standard"), ({"legacy_only": True}, None, "Standard"), ({}, None, "DenseBoost")],
    ids=["standard", "legacy", "dense"],
)
def test_replayed_through_the_driver_a_capture_gives_what_it_gives_from_the_file(
    tmp_path, sensor, wish, name
):
    path = tmp_path / "a.rplidar"
    with (
        CaptureWriter(path) as capture,
        EmulatorProcess(spin_up=0, **sensor) as emulator,
        Driver(emulator.port, mode=wish, tap=capture.write) as driver,
    ):
        modes = driver.modes
        for _ in islice(driver, 10):
            pass
    with EmulatorProcess(replay=path) as emulator, Driver(emulator.port) as driver:
        replayed = list(islice(driver, 7))
        told = driver.statistics
        assert (driver.mode.name, driver.modes) == (name, modes)
    assert told.rate_hz == pytest.approx(10, rel=0.05)
    assert np.diff([scan.stamp for scan in replayed]) == pytest.approx(0.1, rel=0.1)
    for scan, seen in zip(replayed, open_recording(path), strict=False):
        np.testing.assert_array_equal(scan.ranges, seen.ranges)
        np.testing.assert_allclose(scan.bearings, seen.bearings)
        np.testing.assert_allclose(scan.beam_times, seen.beam_times, atol=1e-6)


@pytest.mark.long
def test_a_capture_begun_amid_another_mode_than_the_usual_is_replayed_in_it(tmp_path):
    """As the recorder writes it when it is started later than the sensor."""
    nodes = np.arange(4000) * 360 * 10 * 244e-6 % 360
    begins = np.diff(nodes, prepend=0) < 0
    data = encode_nodes(nodes, np.full(4000, 2000.0), np.full(4000, 47), begins)
    with CaptureWriter(tmp_path / "a.rplidar", Stream(Answer.NODES, 244.0)) as capture:
        for at in range(0, 4000, 16):
            capture.write("in", 1.7e9 + at * 244e-6, data[5 * at : 5 * (at + 16)])
    with EmulatorProcess(replay=tmp_path / "a.rplidar") as emulator, Driver(emulator.port) as driver:
        replayed = list(islice(driver, 5))
        assert (driver.mode.name, driver.mode.us_per_sample) == ("Standard", 244)
    assert np.diff([scan.stamp for scan in replayed]) == pytest.approx(0.1, rel=0.1)
    assert np.array([np.ptp(scan.beam_times) for scan in replayed]) == pytest.approx(0.1, rel=0.02)
