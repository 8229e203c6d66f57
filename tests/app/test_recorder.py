"""The recorder beside the live view: it never holds up its caller, and says what goes wrong."""

import threading
import time
from dataclasses import asdict, replace

import numpy as np
import pytest
from captures import read_capture
from lidarcore_app.errors import ConflictError
from lidarcore_app.jobs.recorder import AsyncRecorder
from lidarcore_app.jobs.spooler import Spooler
from waiting import PATIENCE, wait_until

from lidarcore import RecordingError, extract, open_recording
from lidarcore.rplidar.capture import Stream
from lidarcore.simulation import SimulatedSensor, furnished_room


@pytest.fixture
def recorder():
    made = AsyncRecorder()
    yield made
    made.stop()


@pytest.fixture(scope="module")
def scans():
    sensor, rng = SimulatedSensor(furnished_room()), np.random.default_rng(0)
    return [sensor.scan(np.array([4.5, 4.0, 0.0]), rng, 1e9 + 0.1 * k)[0] for k in range(12)]


def test_scans_are_recorded_from_start_to_stop(recorder, tmp_path, scans):
    recorder.put(scans[0])  # nothing runs yet
    recorder.start(tmp_path / "a.mcap")
    for scan in scans[1:11]:
        recorder.put(scan, extract(scan))
    status = recorder.stop()
    recorder.put(scans[11])
    read = list(open_recording(tmp_path / "a.mcap"))
    assert [scan.stamp for scan in read] == [scan.stamp for scan in scans[1:11]]
    size = (tmp_path / "a.mcap").stat().st_size
    assert asdict(status) == {
        "state": "idle",
        "name": "a.mcap",
        "raw": False,
        "size": size,
        "duration": pytest.approx(0.9),
        "scans": 10,
        "rate": pytest.approx(size / 0.9),
        "dropped": 0,
        "error": None,
    }


def test_the_status_counts_while_recording(recorder, tmp_path, scans):
    assert recorder.status.state == "idle"
    assert recorder.status.name is None
    recorder.start(tmp_path / "a.mcap")
    assert recorder.status.state == "recording"
    for scan in scans[:3]:
        recorder.put(scan)
    wait_until(lambda: recorder.status.size > 0)
    assert recorder.status.size == (tmp_path / "a.mcap").stat().st_size
    assert recorder.status.scans == 3
    assert recorder.status.rate > 0
    assert [scan.stamp for scan in open_recording(tmp_path / "a.mcap")] == [scan.stamp for scan in scans[:3]]


def test_the_bytes_of_the_port_are_captured_beside(recorder, tmp_path, scans):
    recorder.start(tmp_path / "a.mcap", raw=tmp_path / "a.rplidar", stream=Stream(0x85, 108.0))
    pieces = [("out", 1.0, b"\xa5\x25"), ("in", 1.5, bytes(84)), ("in", 2.0, b"")]
    for piece in pieces:
        recorder.tap(*piece)
    recorder.put(scans[0])
    status = recorder.stop()
    recorder.tap("in", 3.0, b"late")
    assert list(read_capture(tmp_path / "a.rplidar")) == pieces
    assert status.raw
    assert status.size == sum((tmp_path / name).stat().st_size for name in ("a.mcap", "a.rplidar"))


def test_one_recording_at_a_time(recorder, tmp_path):
    recorder.start(tmp_path / "a.mcap")
    with pytest.raises(ConflictError, match=r"a\.mcap is being recorded: stop that first"):
        recorder.start(tmp_path / "b.mcap")
    assert not (tmp_path / "b.mcap").exists()


@pytest.mark.parametrize("taken", ["a.mcap", "a.rplidar"])
def test_nothing_starts_if_one_of_the_files_exists(recorder, tmp_path, scans, taken):
    (tmp_path / taken).write_text("precious")
    with pytest.raises(RecordingError, match="exists already"):
        recorder.start(tmp_path / "a.mcap", raw=tmp_path / "a.rplidar")
    recorder.put(scans[0])
    assert recorder.status.state == "idle"
    assert [path.name for path in tmp_path.iterdir()] == [taken]
    assert (tmp_path / taken).read_text() == "precious"


def test_a_recording_without_a_scan_leaves_nothing(recorder, tmp_path):
    recorder.start(tmp_path / "a.mcap", raw=tmp_path / "a.rplidar")
    assert recorder.stop().scans == 0
    assert list(tmp_path.iterdir()) == []


def test_one_bad_scan_ends_the_recording_with_its_reason_and_keeps_the_rest(recorder, tmp_path, scans):
    recorder.start(tmp_path / "a.mcap")
    recorder.put(scans[0])
    recorder.put(replace(scans[1], stamp=1e12))
    wait_until(lambda: recorder.status.state == "failed")
    assert "32 bits" in recorder.status.error
    recorder.put(scans[2])
    recorder.stop()
    (read,) = open_recording(tmp_path / "a.mcap")
    np.testing.assert_array_equal(read.bearings, scans[0].bearings)
    recorder.start(tmp_path / "b.mcap")
    assert recorder.status.error is None


def test_many_threads_may_use_it_at_once(recorder, tmp_path, scans):
    recorder.start(tmp_path / "a.mcap")
    busy = [threading.Thread(target=lambda: [recorder.status for _ in range(200)]) for _ in range(4)]
    busy += [threading.Thread(target=recorder.put, args=(scan,)) for scan in scans]
    busy += [threading.Thread(target=recorder.stop) for _ in range(3)]
    for thread in busy:
        thread.start()
    for thread in busy:
        thread.join(PATIENCE)
    status = recorder.stop()
    assert status.state == "idle"
    assert len(list(open_recording(tmp_path / "a.mcap"))) == status.scans


class SlowDisk:
    """What a spooler writes to, which takes nothing until it is let go."""

    def __init__(self):
        self.taken, self.errors, self.idle, self.closed = [], [], threading.Event(), threading.Event()
        self.free, self.busy = threading.Event(), threading.Event()

    def spooler(self, length):
        spooler = Spooler(length, self.write, self.idle.set, self.closed.set, self.errors.append)
        spooler.start()
        return spooler

    def write(self, item):
        self.busy.set()
        assert self.free.wait(PATIENCE)
        if item == "bad":
            raise RecordingError("This one is bad.")
        self.taken.append(item)


def test_a_slow_disk_costs_what_does_not_fit_and_never_the_callers_time():
    disk = SlowDisk()
    spooler = disk.spooler(10)
    begin = time.perf_counter()
    spooler.put(0)
    assert disk.busy.wait(PATIENCE)  # the first is in the writer's hand, ten fit into the queue
    for item in range(1, 1000):
        spooler.put(item)
    assert time.perf_counter() - begin < PATIENCE / 2  # the disk stands still all the while
    assert spooler.dropped == 989
    disk.free.set()
    spooler.end()
    spooler.join()
    assert disk.taken == list(range(11))
    assert disk.closed.is_set()


def test_a_spooler_has_a_chance_to_flush_while_nothing_comes():
    disk = SlowDisk()
    spooler = disk.spooler(10)
    assert disk.idle.wait(PATIENCE)
    spooler.end()
    assert disk.closed.wait(PATIENCE)


def test_a_spooler_that_fails_says_why_and_closes():
    disk = SlowDisk()
    disk.free.set()
    spooler = disk.spooler(10)
    for item in ("good", "bad", "never"):
        spooler.put(item)
    assert disk.closed.wait(PATIENCE)
    spooler.join()
    assert disk.taken == ["good"]
    assert disk.errors == ["This one is bad."]
