import gzip
import math
import shutil
import sqlite3
import struct

import numpy as np
import pytest
from backports import zstd
from mcap.writer import CompressionType
from ros_writers import drive, laser, write_bag1, write_mcap
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from lidarcore.errors import RecordingError
from lidarcore.recordings import open_recording

TURTLEBOT = "turtlebot4_rplidar_rosbag2/macfirst_floor_take_2"


def lasers_by_rosbags(path):
    """The LaserScan messages, read by rosbags' own readers."""
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        wanted = [connection for connection in reader.connections if connection.topic == "/scan"]
        for connection, _, raw in reader.messages(connections=wanted):
            yield reader.deserialize(raw, connection.msgtype)


@pytest.mark.parametrize("name", ["rplidar_rosbag1/lidar.bag", TURTLEBOT])
def test_scans_are_those_that_rosbags_reads(data, name):
    for scan, laser_ in zip(open_recording(data / name), lasers_by_rosbags(data / name), strict=True):
        raw = laser_.ranges.astype(float)
        raw[~((raw >= laser_.range_min) & (raw < laser_.range_max))] = np.nan
        np.testing.assert_array_equal(scan.ranges, raw)
        last = laser_.angle_min + laser_.angle_increment * (len(raw) - 1)
        np.testing.assert_allclose(scan.bearings, np.linspace(laser_.angle_min, last, len(raw)), atol=1e-9)
        assert scan.bearings[-1] == pytest.approx(laser_.angle_max, abs=0.02)
        assert scan.stamp == pytest.approx(
            laser_.header.stamp.sec + laser_.header.stamp.nanosec / 1e9, abs=1e-6
        )
        np.testing.assert_array_equal(scan.quality, laser_.intensities)
        # Of both RPLIDARs the beams were taken the other way round.
        np.testing.assert_allclose(np.diff(scan.beam_times), -laser_.time_increment, atol=1e-9)
        assert scan.beam_times[-1] == 0


@pytest.mark.parametrize(
    ("name", "scans", "seconds", "beams", "first", "last"),
    [
        ("rplidar_rosbag1/lidar.bag", 485, 37.5, 360, -3.1241, 3.1416),
        (TURTLEBOT, 357, 46.2, 720, -3.1241, 3.1416),
        # The note and rosbags' index say 278 scans; they lie in the first of two chunks. See the next test.
        ("ccny_hokuyo_rosbag1/demo.bag", 360, 35.8, 681, -2.08621, 2.08621),
    ],
)
def test_real_bags_have_what_is_known_of_them(data, name, scans, seconds, beams, first, last):
    read = list(open_recording(data / name))
    assert len(read) == scans
    assert read[-1].stamp - read[0].stamp == pytest.approx(seconds, abs=0.1)
    assert {len(scan) for scan in read} == {beams}
    assert read[0].bearings[[0, -1]] == pytest.approx([first, last], abs=1e-4)


def test_the_bag_with_the_broken_index_is_read_to_its_end(data):
    """Its two chunk-info records, which are sound, count 278 and 82 messages."""
    path = data / "ccny_hokuyo_rosbag1/demo.bag"
    content = path.read_bytes()
    counts = []
    for position in (content.find(b"op=\x06"), content.rfind(b"op=\x06")):
        data_at = content.index(struct.pack("<II", 8, 0), position)  # 8 bytes: connection 0 and its count
        counts.append(struct.unpack_from("<I", content, data_at + 8)[0])
    assert counts == [278, 82]
    scans = list(open_recording(path))
    assert len(scans) == sum(counts)
    steps = np.diff([scan.stamp for scan in scans])
    assert (steps > 0.09).all()
    assert (steps < 0.11).all()
    ranges = np.concatenate([scan.ranges for scan in scans[:278]])
    assert np.mean(np.isfinite(ranges)) == pytest.approx(0.94, abs=0.005)
    assert np.nanpercentile(ranges, [1, 50, 99]) == pytest.approx([0.78, 1.73, 3.83], abs=0.005)


@pytest.mark.parametrize(
    ("of", "turn", "ends", "beams", "takes", "backwards"),
    [
        ("RPLIDAR", 359, 180, 720, 0.1345, True),
        ("RPLIDAR, newer node", 360, 180, 1440, 0.1, True),
        ("another that counts as many intervals as beams", 360, 180, 720, 0.1 * 719 / 720, False),
        ("another that begins elsewhere", 359, 179, 360, 0.1, False),
        ("another that sees three quarters", 270, 135, 1080, 0.1, False),
    ],
)
def test_which_scans_are_listed_from_their_last_beam(tmp_path, of, turn, ends, beams, takes, backwards):
    first, last = math.radians(ends - turn), math.radians(ends)
    fields = {
        "angle_min": first,
        "angle_max": last,
        "angle_increment": (last - first) / (beams - 1),
        "time_increment": takes / (beams - 1),
        "scan_time": takes if backwards or turn != 360 else 0.1,
    }
    message = laser(100.0, np.full(beams, 2.0), **fields)
    write_bag1(tmp_path / "a.bag", [("/scan", "sensor_msgs/LaserScan", message, 100.0)])
    recording = open_recording(tmp_path / "a.bag")
    (scan,) = recording
    right, left = (int(np.argmin(np.abs(scan.bearings - at))) for at in (-1.0, 1.0))
    ahead = (scan.beam_times[left] - scan.beam_times[right]) / (scan.bearings[left] - scan.bearings[right])
    assert ahead == pytest.approx((-1 if backwards else 1) * takes / math.radians(turn), rel=1e-4)
    assert any("beam times turned" in note for note in recording.notes) == backwards


def test_ranges_beyond_range_max_are_missing(data):
    recording = open_recording(data / TURTLEBOT)
    scans = list(recording)
    raw = np.concatenate([laser_.ranges for laser_ in lasers_by_rosbags(data / TURTLEBOT)])
    beyond = int(np.sum(np.isfinite(raw) & (raw >= 12.0)))
    assert beyond > 1000
    assert max(np.nanmax(scan.ranges) for scan in scans) < 12.0
    assert f"{beyond} ranges at or beyond range_max (12 m) taken as missing." in recording.notes


def test_a_yaw_of_mounting_turns_the_odometry(data):
    recording = open_recording(data / TURTLEBOT)
    assert recording.T_base_sensor == pytest.approx([0.0039, 0, math.pi / 2], abs=1e-4)
    with AnyReader([data / TURTLEBOT], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        wanted = [connection for connection in reader.connections if connection.topic == "/odom"]
        poses = [
            reader.deserialize(raw, connection.msgtype) for connection, _, raw in reader.messages(wanted)
        ]
    stamps = np.array([pose.header.stamp.sec + pose.header.stamp.nanosec / 1e9 for pose in poses])
    known = 0
    for scan in recording:
        if scan.odometry is None:
            assert not stamps[0] <= scan.stamp <= stamps[-1]
            continue
        known += 1
        nearest = poses[int(np.argmin(np.abs(stamps - scan.stamp)))].pose.pose
        heading = 2 * math.atan2(nearest.orientation.z, nearest.orientation.w)
        turned = math.remainder(scan.odometry[2] - heading - math.pi / 2, 2 * math.pi)
        assert abs(turned) < 0.1
        assert scan.odometry[:2] == pytest.approx([nearest.position.x, nearest.position.y], abs=0.05)
    assert known > 350


def test_two_walls_of_a_corridor_fall_together_by_the_odometry(data):
    """The map made of all scans by their odometry is far sharper than with the mounting's yaw left out."""
    scans = [scan for scan in open_recording(data / TURTLEBOT) if scan.odometry is not None][::10]

    def cells(turn):
        seen = set()
        for scan in scans:
            near = scan.xy[scan.valid & (np.nan_to_num(scan.ranges, nan=9) < 5)]
            x, y, heading = scan.odometry
            c, s = math.cos(heading + turn), math.sin(heading + turn)
            world = near @ np.array([[c, s], [-s, c]]) + [x, y]
            seen |= set(map(tuple, np.floor(world / 0.1).astype(int)))
        return len(seen)

    assert cells(0.0) < 0.6 * min(cells(-math.pi / 2), cells(math.pi), cells(math.pi / 2))


def test_a_database_without_its_metadata_can_be_read(data, tmp_path):
    for copy in (tmp_path / "lonely.db3", tmp_path / "no suffix? #1"):
        shutil.copy(next((data / TURTLEBOT).glob("*.db3")), copy)
        assert len(list(open_recording(copy))) == 357
    folder = tmp_path / "bag"
    folder.mkdir()
    shutil.copy(next((data / TURTLEBOT).glob("*.db3")), folder)
    assert len(list(open_recording(folder))) == 357


def test_a_packed_database_can_be_read(data, tmp_path):
    content = next((data / TURTLEBOT).glob("*.db3")).read_bytes()
    for name, packed in (
        ("bag.db3.zstd", zstd.compress(content, 1)),
        ("bag.db3.gz", gzip.compress(content, 1)),
    ):
        (tmp_path / name).write_bytes(packed)
        assert len(list(open_recording(tmp_path / name))) == 357


def test_packed_messages_can_be_read(data, tmp_path):
    path = tmp_path / "messages.db3"
    shutil.copy(next((data / TURTLEBOT).glob("*.db3")), path)
    with sqlite3.connect(path) as database:
        database.create_function("pack", 1, zstd.compress)
        database.execute("UPDATE messages SET data = pack(data)")
    for scan, other in zip(open_recording(path), open_recording(data / TURTLEBOT), strict=True):
        np.testing.assert_array_equal(scan.ranges, other.ranges)


def test_the_files_of_a_split_bag_are_joined_in_order(tmp_path):
    messages = drive()
    scans = [message for message in messages if message[0] == "/scan"]
    others = [message for message in messages if message[0] != "/scan"]
    for index in (0, 1, 2, 10):
        part = others + scans[:2] if index == 0 else [scans[min(index, 3) + 1]]
        write_mcap(tmp_path / f"bag_{index}.mcap", part, CompressionType.NONE)
    with pytest.raises(RecordingError, match=r"no metadata.yaml.*bag_0.mcap, bag_1.mcap"):
        open_recording(tmp_path)
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    stamps = [scan.stamp for scan in open_recording(tmp_path)]
    assert stamps == pytest.approx(100 + np.array([0.02, 0.12, 0.22, 0.32, 0.42]), abs=1e-6)


def test_old_bags_are_refused_with_advice(tmp_path):
    (tmp_path / "old.bag").write_bytes(b"#ROSBAG V1.2\n" + bytes(100))
    with pytest.raises(RecordingError, match=r"version '1\.2'.*rosbag"):
        open_recording(tmp_path / "old.bag")


def test_a_database_that_is_no_bag_is_refused(tmp_path):
    with sqlite3.connect(tmp_path / "music.db") as database:
        database.execute("CREATE TABLE songs (title)")
    with pytest.raises(RecordingError, match="not a ROS 2 bag"):
        open_recording(tmp_path / "music.db")
