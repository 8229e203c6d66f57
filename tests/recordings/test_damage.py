"""Damaged files: a RecordingError, or what can be saved."""

import gzip
import re
import struct

import numpy as np
import pytest
from backports import zstd
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType
from real_recordings import where
from recorded_scans import demo, dense_stream
from ros_writers import drive, write_bag1, write_mcap
from scipy.io import savemat

from lidarcore import extract
from lidarcore.errors import RecordingError
from lidarcore.recordings import open_recording
from lidarcore.recordings.writer import RecordingWriter
from lidarcore.rplidar.capture import CaptureWriter, Stream

SWEEP = {"deadline": None, "suppress_health_check": [HealthCheck.function_scoped_fixture], "database": None}

SAMPLES = (
    "real.bag", "bz2.bag", "lz4.bag", "real.db3", "plain.mcap", "zstd.mcap", "carmen.log", "carmen.log.gz",
    "carmen.log.zstd", "table.csv", "rooms.csv", "dump.txt", "plain.mat", "packed.mat", "plain.npz", "packed.npz",
    "points.json", "own.mcap", "own.rplidar", "hex.txt",
)  # fmt: skip
IN_ONE_PIECE = (".mat", ".npz", ".json")  # of which a part cannot be read


@pytest.fixture(scope="module")
def samples(data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("samples")
    drives = [(*message[:3], message[3] + 2 * lap) for lap in range(30) for message in drive()]
    write_bag1(folder / "bz2.bag", drives, "bz2")
    write_bag1(folder / "lz4.bag", drives, "lz4")
    write_mcap(folder / "plain.mcap", drives, CompressionType.NONE)
    write_mcap(folder / "zstd.mcap", drives, CompressionType.ZSTD)
    (folder / "real.bag").write_bytes((data / "ccny_hokuyo_rosbag1/demo.bag").read_bytes())
    database = next((data / "turtlebot4_rplidar_rosbag2/macfirst_floor_take_2").glob("*.db3"))
    (folder / "real.db3").write_bytes(database.read_bytes())

    def lines(name, count):
        return b"".join(gzip.decompress((data / name).read_bytes()).splitlines(keepends=True)[:count])

    carmen = lines("carmen_radish_corrected/intel-corrected.log.gz", 2000)
    (folder / "carmen.log").write_bytes(carmen)
    (folder / "carmen.log.gz").write_bytes(gzip.compress(carmen))
    (folder / "carmen.log.zstd").write_bytes(zstd.compress(carmen))
    table = "intel_odometry_groundtruth/intel_scans_odom_corrected.csv.gz"
    (folder / "table.csv").write_bytes(lines(table, 100))
    (folder / "rooms.csv").write_bytes(lines("rplidar_csv_rooms/golf_room.csv.gz", 3000))
    (folder / "dump.txt").write_bytes(
        3 * (data / "rplidar_raw_serial_hex/frame_grabber_Data.txt").read_bytes()
    )
    (folder / "points.json").write_bytes(where("tau_rplidar_c1_rooms/lab446__scans.json").read_bytes())
    arrays = {"ranges": np.random.default_rng(0).uniform(1, 9, (40, 90)), "bearings": np.linspace(-3, 3, 90)}
    savemat(folder / "plain.mat", arrays)
    savemat(folder / "packed.mat", arrays, do_compression=True)
    np.savez(folder / "plain.npz", **arrays)
    np.savez_compressed(folder / "packed.npz", **arrays)
    with RecordingWriter(folder / "own.mcap") as recording:
        for scan in demo(60):
            recording.write(scan, extract(scan))
    with CaptureWriter(folder / "own.rplidar", Stream(0x85, 108.0)) as capture:
        for capsule, time in dense_stream(30):
            capture.write("in", time, capsule)
    (folder / "hex.txt").write_bytes(
        (data / "rplidar_raw_serial_hex/sample_data_motorctrl_1st_try.txt").read_bytes()
    )
    return folder


WHOLE_LINE = re.compile(rb"(\n|0x[0-9a-f]{2})\Z")


def read(path):
    """All scans with the recording's notes, or None if it is refused with a clear error."""
    try:
        recording = open_recording(path, "dev1" if "points" in path.name else None)
        scans = list(recording)
    except RecordingError:
        return None
    for scan in scans:
        assert np.isfinite(scan.bearings).all()
        assert not (scan.ranges <= 0).any()
        assert not np.isinf(scan.ranges).any()
    return scans, recording.notes


@pytest.mark.parametrize("name", SAMPLES)
def test_of_a_truncated_file_everything_before_the_cut_is_read(samples, tmp_path, name):
    whole, _ = read(samples / name)
    content = (samples / name).read_bytes()

    @given(st.integers(0, len(content) - 1))
    @settings(max_examples=12, **SWEEP)
    def sweep(cut):
        path = tmp_path / name
        path.write_bytes(content[:cut])
        found = read(path)
        if found is None:
            return
        scans, notes = found
        assert len(scans) <= len(whole)
        sure = (
            len(scans) - 1 if name in ("rooms.csv", "dump.txt") else len(scans)
        )  # the last revolution is shorter
        for scan, other in zip(scans[:sure], whole[:sure], strict=True):
            np.testing.assert_array_equal(scan.ranges, other.ranges)
            np.testing.assert_array_equal(scan.bearings, other.bearings)
        if name.endswith(IN_ONE_PIECE):
            assert len(scans) == len(whole)
        elif len(scans) < len(whole):
            told = any("damaged" in note or "left out" in note for note in notes)
            assert told or WHOLE_LINE.search(content[:cut])  # which is what a shorter file looks like

    sweep()


@pytest.mark.parametrize("name", SAMPLES)
def test_bytes_that_flip_do_no_harm(samples, tmp_path, name):
    content = (samples / name).read_bytes()

    @given(
        st.lists(
            st.tuples(st.integers(0, len(content) - 1) | st.integers(0, 300), st.integers(1, 255)), max_size=8
        )
    )
    @settings(max_examples=12, **SWEEP)
    def sweep(flips):
        damaged = bytearray(content)
        for position, change in flips:
            damaged[position % len(content)] ^= change
        path = tmp_path / name
        path.write_bytes(damaged)
        read(path)

    sweep()


@pytest.mark.parametrize("share", [0.1, 0.35, 0.6, 0.9])
def test_a_truncated_log_loses_no_line_that_is_whole(samples, tmp_path, share):
    content = (samples / "carmen.log").read_bytes()
    cut = content[: int(share * len(content))]
    (tmp_path / "cut.log").write_bytes(cut)
    scans, _ = read(tmp_path / "cut.log")
    assert len(scans) == sum(line.startswith(b"FLASER") for line in cut.split(b"\n")[:-1]) > 0


@pytest.mark.parametrize("share", [0.1, 0.35, 0.6, 0.9])
def test_a_truncated_bag_loses_no_message_that_is_whole(samples, tmp_path, share):
    content = (samples / "real.bag").read_bytes()
    cut = content[: int(share * len(content))]
    (tmp_path / "cut.bag").write_bytes(cut)
    scans, notes = read(tmp_path / "cut.bag")
    start, whole = cut.find(b"op=\x02"), 0
    while start >= 0:  # after op: time (17 bytes), then the length of the message
        end = start + 4 + 17
        whole += end + 4 <= len(cut) and end + 4 + struct.unpack_from("<I", cut, end)[0] <= len(cut)
        start = cut.find(b"op=\x02", start + 1)
    assert len(scans) == whole > 0
    assert any("cut short" in note for note in notes)


@pytest.mark.parametrize("share", [0.1, 0.35, 0.6, 0.9])
def test_a_truncated_database_loses_no_more_than_what_is_cut(samples, tmp_path, share):
    content = (samples / "real.db3").read_bytes()
    cut = content[: int(share * len(content))]
    (tmp_path / "cut.db3").write_bytes(cut)
    (tmp_path / "cut.db3.zstd").write_bytes(zstd.compress(cut, 1))
    for name in ("cut.db3", "cut.db3.zstd"):
        scans, notes = read(tmp_path / name)
        assert len(scans) == pytest.approx(share * 357, abs=10)
        assert any("cut short" in note for note in notes)


def test_a_truncated_mcap_keeps_the_chunks_before(samples, tmp_path):
    content = (samples / "zstd.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) // 2])
    scans, _ = read(tmp_path / "cut.mcap")
    assert 0.25 * 300 < len(scans) < 300


def test_a_damaged_chunk_costs_only_itself(samples, tmp_path):
    content = bytearray((samples / "plain.mcap").read_bytes())
    content[len(content) // 3] ^= 0xFF
    (tmp_path / "flip.mcap").write_bytes(content)
    scans, notes = read(tmp_path / "flip.mcap")
    assert 250 < len(scans) < 300
    assert "1 damaged chunk, whose rest is left out." in notes


def test_an_old_laser_line_cut_anywhere_is_never_half_read(samples, tmp_path):
    line = next(
        line for line in (samples / "carmen.log").read_bytes().splitlines() if line.startswith(b"FLASER")
    )
    (tmp_path / "a.log").write_bytes(line + b"\n" + line)
    (scan,) = open_recording(tmp_path / "a.log")
    assert len(scan) == 180


HEAD = "t,angle_min,angle_increment,r0,r1,r2"
ROWS = ["0.0,-0.1,0.1,2.25,3.50,4.125", "0.1,-0.1,0.1,2.26,3.51,4.137", "0.2,-0.1,0.1,2.27,3.52,4.149"]


def test_a_table_without_a_last_newline_keeps_its_last_scan_unless_a_digit_is_missing(tmp_path):
    text = "\n".join([HEAD, *ROWS])
    for cut in range(1, len(ROWS[-1])):
        (tmp_path / "cut.csv").write_text(text[:-cut])
        scans, notes = read(tmp_path / "cut.csv")
        assert len(scans) == 2
        assert "The last line does not end: left out." in notes
    (tmp_path / "whole.csv").write_text(text)
    scans, notes = read(tmp_path / "whole.csv")
    np.testing.assert_array_equal(scans[-1].ranges, [2.27, 3.52, 4.149])
    assert len(scans) == 3
    assert not any("does not end" in note for note in notes)


@pytest.mark.parametrize("rows", [[HEAD, ROWS[0]], ["FLASER 3 2.25 3.50 4.125 1 2 0.5 1 2 0.5 7.5 host 7.5"]])
def test_a_single_scan_without_a_last_newline_is_read_and_noted(tmp_path, rows):
    (tmp_path / "one.log").write_text("\n".join(rows))
    recording = open_recording(tmp_path / "one.log")
    (scan,) = recording
    np.testing.assert_array_equal(scan.ranges, [2.25, 3.5, 4.125])
    assert "The last line does not end: its last number may be cut." in recording.notes
