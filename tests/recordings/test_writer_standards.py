"""What RecordingWriter writes, read by what nobody here wrote: rosbags, and Foxglove's libraries for MCAP and ROS 2."""

import math
from collections import Counter
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory
from recorded_scans import KINDS, UNIX, clockwise, demo, half_view, single
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader as BagReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lidarcore import extract, open_recording
from lidarcore.recordings.writer import RecordingWriter

TOPICS = {
    "/scan": "sensor_msgs/msg/LaserScan",
    "/scan/beams": "lidarcore_msgs/msg/Beams",
    "/odom": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/features": "visualization_msgs/msg/MarkerArray",
}


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A recording of everything, the scans and the features."""
    path = tmp_path_factory.mktemp("drive") / "drive.mcap"
    scans = [
        type(scan)(
            scan.ranges, scan.bearings, scan.stamp, scan.quality, scan.beam_times, (0.1 * k, 1.0, 0.01 * k)
        )
        for k, scan in enumerate(demo(40))
    ]
    features = [extract(scan) for scan in scans]
    with RecordingWriter(path, sensor="a sensor") as recording:
        for scan, found in zip(scans, features, strict=True):
            recording.write(scan, found)
    return path, scans, features


def by_rosbags(path):
    """Topic, time and message, decoded by the definitions in the file alone."""
    with AnyReader([path], default_typestore=get_typestore(Stores.EMPTY)) as reader:
        for connection, time, raw in reader.messages():
            yield connection.topic, time, reader.deserialize(raw, connection.msgtype)


def by_foxglove(path):
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, raw, message in reader.iter_decoded_messages():
            yield channel.topic, raw.log_time, message


READERS = pytest.mark.parametrize("read", [by_rosbags, by_foxglove])


@READERS
def test_both_libraries_find_every_message_in_order(drive, read):
    path, scans, _ = drive
    messages = list(read(path))
    assert Counter(topic for topic, _, _ in messages) == dict.fromkeys(TOPICS, len(scans))
    times = [time for _, time, _ in messages]
    assert times == sorted(times)
    assert times[0] == round(UNIX) * 10**9
    assert times[-1] - times[0] == pytest.approx(3.9e9, abs=1e3)


@READERS
def test_laser_scans_equal_the_scans(drive, read):
    path, scans, _ = drive
    lasers = [message for topic, _, message in read(path) if topic == "/scan"]
    for laser, scan in zip(lasers, scans, strict=True):
        assert laser.header.frame_id == "laser"
        assert laser.header.stamp.sec + laser.header.stamp.nanosec / 1e9 == scan.stamp
        ranges = np.array(laser.ranges)
        np.testing.assert_array_equal(ranges[scan.valid], single(scan.ranges[scan.valid]))
        assert np.isposinf(ranges[~scan.valid]).all()
        np.testing.assert_array_equal(laser.intensities, single(scan.quality))
        grid = laser.angle_min + laser.angle_increment * np.arange(len(scan))
        assert laser.angle_max == pytest.approx(grid[-1], abs=1e-5)
        assert np.abs(grid - scan.bearings).max() < laser.angle_increment
        assert laser.time_increment == pytest.approx(0.1 / 920, rel=1e-3)
        assert laser.scan_time == pytest.approx(0.1, rel=1e-3)


@READERS
def test_beams_are_the_exact_bearings(drive, read):
    path, scans, _ = drive
    beams = [message for topic, _, message in read(path) if topic == "/scan/beams"]
    for message, scan in zip(beams, scans, strict=True):
        np.testing.assert_array_equal(message.bearings, scan.bearings)
        np.testing.assert_array_equal(message.times, single(scan.beam_times))


@READERS
def test_odometry_and_its_transform_are_the_pose_of_the_sensor(drive, read):
    path, scans, _ = drive
    messages = list(read(path))
    poses = [message for topic, _, message in messages if topic == "/odom"]
    moves = [message for topic, _, message in messages if topic == "/tf"]
    for odometry, tree, scan in zip(poses, moves, scans, strict=True):
        (transform,) = tree.transforms
        for head, child in ((odometry.header, odometry), (transform.header, transform)):
            assert (head.frame_id, child.child_frame_id) == ("odom", "laser")
        for place, turn in (
            (odometry.pose.pose.position, odometry.pose.pose.orientation),
            (transform.transform.translation, transform.transform.rotation),
        ):
            heading = math.atan2(2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y**2 + turn.z**2))
            assert [place.x, place.y, place.z, heading] == pytest.approx(
                [*scan.odometry[:2], 0, scan.odometry[2]]
            )


@READERS
def test_markers_are_the_walls_the_corners_and_their_ellipses(drive, read):
    path, _, features = drive
    arrays = [message for topic, _, message in read(path) if topic == "/features"]
    for array, found in zip(arrays, features, strict=True):
        first, walls, dots, *discs = array.markers
        assert (first.action, walls.type, dots.type) == (3, 5, 7)  # DELETEALL, LINE_LIST, SPHERE_LIST
        ends = np.array([[p.x, p.y] for p in walls.points]).reshape(-1, 2, 2)
        np.testing.assert_array_equal(ends[:, 0], found.segments.start)
        np.testing.assert_array_equal(ends[:, 1], found.segments.end)
        np.testing.assert_array_equal([[p.x, p.y] for p in dots.points], found.corners.xy)
        for disc, xy, covariance in zip(discs, found.corners.xy, found.corners.covariance, strict=True):
            assert disc.type == 3  # CYLINDER
            assert [disc.pose.position.x, disc.pose.position.y] == xy.tolist()
            turn = 2 * math.atan2(disc.pose.orientation.z, disc.pose.orientation.w)
            axes = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
            squared = (
                np.diag([disc.scale.x, disc.scale.y]) ** 2 / 4 / 10**2
            )  # scales are diameters, of 10 sigma
            np.testing.assert_allclose(axes @ squared @ axes.T, covariance, rtol=1e-6, atol=3e-9)


def test_a_lost_sector_keeps_its_places_in_the_laser_scan(tmp_path):
    """A LaserScan knows even steps only: without room for what was lost, all beams after it would be turned."""
    scan = clockwise(((400, 520), (600, 640)))
    with RecordingWriter(tmp_path / "a.mcap") as recording:
        recording.write(scan)
    (laser,) = [message for topic, _, message in by_rosbags(tmp_path / "a.mcap") if topic == "/scan"]
    assert len(laser.ranges) == 926
    lost = np.isnan(laser.ranges)
    assert np.flatnonzero(lost).tolist() == [*range(400, 520), *range(600, 640)]
    bearings = laser.angle_min + laser.angle_increment * np.arange(926)
    np.testing.assert_allclose(bearings[~lost][::-1], scan.bearings, atol=1e-4)
    assert laser.time_increment == pytest.approx(108e-6, rel=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_laser_scans_of_every_kind_obey_their_limits(tmp_path, kind):
    """REP-117: a range outside [range_min, range_max] is dropped by other programs."""
    scan = KINDS[kind]
    with RecordingWriter(tmp_path / "a.mcap") as recording:
        recording.write(scan, extract(scan))
    (laser,) = [message for topic, _, message in by_rosbags(tmp_path / "a.mcap") if topic == "/scan"]
    seen = laser.ranges[np.isfinite(laser.ranges)]
    assert len(seen) == scan.valid.sum()
    assert ((seen >= laser.range_min) & (seen < laser.range_max)).all()
    assert laser.angle_increment != 0
    assert np.isfinite(
        [laser.angle_min, laser.angle_max, laser.angle_increment, laser.range_min, laser.range_max]
    ).all()


def test_the_file_is_indexed_and_says_what_it_holds(drive):
    path, scans, _ = drive
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
        assert {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values()} == TOPICS
        assert {c.message_encoding for c in summary.channels.values()} == {"cdr"}
        assert all("offered_qos_profiles" in c.metadata for c in summary.channels.values())
        assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
        assert summary.statistics.message_count == 5 * len(scans)
        assert summary.statistics.message_end_time - summary.statistics.message_start_time == pytest.approx(
            3.9e9, abs=1e3
        )
        assert len(summary.chunk_indexes) == summary.statistics.chunk_count > 1
        assert all(a.message_end_time < b.message_start_time for a, b in pairwise(summary.chunk_indexes))
        begin = summary.statistics.message_start_time
        found = list(
            reader.iter_messages("/scan", starting_at=begin + 2 * 10**9, ending_before=begin + 3 * 10**9)
        )
        assert len(found) == 10
        (metadata,) = reader.iter_metadata()
        assert metadata.metadata == {"sensor": "a sensor"}
    assert open_recording(path).sensor == "a sensor"


def test_checksums_are_right(drive):
    path, _, _ = drive
    with path.open("rb") as file:
        kinds = Counter(type(record).__name__ for record in StreamReader(file, validate_crcs=True).records)
    assert kinds["Footer"] == 1


def test_the_bag_reader_of_rosbags_opens_it_as_a_bag(drive):
    path, scans, _ = drive
    with BagReader(path) as bag:
        assert bag.message_count == 5 * len(scans)
        assert {connection.topic: connection.msgtype for connection in bag.connections} == TOPICS


def test_a_scan_is_never_torn_over_two_chunks(tmp_path):
    """So that a recording that was cut short ends with a whole scan."""
    scans = demo(30)
    with RecordingWriter(tmp_path / "a.mcap") as recording:
        for scan in scans:
            recording.write(scan, extract(scan))
    with (tmp_path / "a.mcap").open("rb") as file:
        for chunk in make_reader(file).get_summary().chunk_indexes:
            assert len(chunk.message_index_offsets) == 3


def rewrite(path, to, change):
    """Copy a recording, each message changed by `change(topic, message)`, as a program would that edits bags."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    with path.open("rb") as file, to.open("wb") as copy:
        writer = Writer(copy)
        writer.start("ros2")
        for schema, channel, message in make_reader(file).iter_messages():
            store.register(get_types_from_msg(schema.data.decode(), schema.name))
            changed = change(channel.topic, store.deserialize_cdr(message.data, schema.name))
            id_ = writer.register_schema(schema.name, "ros2msg", schema.data)
            id_ = writer.register_channel(channel.topic, "cdr", id_)
            data = bytes(store.serialize_cdr(changed, schema.name))
            writer.add_message(id_, message.log_time, data, message.publish_time)
        writer.finish()


def test_bearings_are_even_where_the_beams_do_not_fit_the_scan(tmp_path):
    """Someone cut the LaserScans to their front half: the Beams are not theirs any more."""
    scan = half_view()
    with RecordingWriter(tmp_path / "a.mcap") as recording:
        recording.write(scan)

    def cut(topic, message):
        return replace(message, ranges=message.ranges[:90]) if topic == "/scan" else message

    rewrite(tmp_path / "a.mcap", tmp_path / "cut.mcap", cut)
    recording = open_recording(tmp_path / "cut.mcap")
    (read,) = recording
    assert len(read) == 90
    np.testing.assert_allclose(read.bearings, scan.bearings[:90], atol=1e-5)
    assert recording.notes == ("1 scan whose exact bearings are lost: even steps taken.",)


def test_a_recording_mounted_upside_down_is_mirrored_with_its_gaps(tmp_path):
    scan = clockwise(((40, 80),))
    upright = replace(scan, quality=None, beam_times=None, odometry=np.zeros(3))
    with RecordingWriter(tmp_path / "a.mcap") as recording:
        recording.write(upright)

    def turn_over(topic, message):
        """As if the odometry were of a base that the sensor hangs below: half a turn about x."""
        if topic == "/odom":
            return replace(message, child_frame_id="base_link")
        if topic == "/tf":
            (transform,) = message.transforms
            half_turn = replace(transform.transform.rotation, x=1.0, w=0.0)
            head = replace(transform.header, frame_id="base_link")
            moved = replace(transform.transform, rotation=half_turn)
            return replace(message, transforms=[replace(transform, header=head, transform=moved)])
        return message

    rewrite(tmp_path / "a.mcap", tmp_path / "hanging.mcap", turn_over)
    (read,) = open_recording(tmp_path / "hanging.mcap")
    np.testing.assert_allclose(read.bearings, -upright.bearings[::-1])
    np.testing.assert_array_equal(read.ranges, single(upright.ranges[::-1]))
    (begin, end), (was_begin, was_end) = read.gaps[0], upright.gaps[0]
    assert [begin, end] == [-was_end, -was_begin]
