import math
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType
from ros_writers import drive, laser, odometry, quaternion, transform, write_bag1, write_mcap

from lidarcore.errors import RecordingError, TopicError
from lidarcore.recordings import open_recording

LASER, TF = "sensor_msgs/LaserScan", "tf2_msgs/TFMessage"

FORMS = [
    ("bag", lambda path, messages: write_bag1(path, messages)),
    ("bz2.bag", lambda path, messages: write_bag1(path, messages, "bz2")),
    ("lz4.bag", lambda path, messages: write_bag1(path, messages, "lz4")),
    ("mcap", lambda path, messages: write_mcap(path, messages, CompressionType.NONE)),
    ("zstd.mcap", lambda path, messages: write_mcap(path, messages, CompressionType.ZSTD)),
    ("lz4.mcap", lambda path, messages: write_mcap(path, messages, CompressionType.LZ4)),
]


@pytest.fixture(params=FORMS, ids=[name for name, _ in FORMS])
def written(request, tmp_path):
    """A function that writes messages to a bag, with each library and compression."""
    name, write = request.param

    def to_file(messages):
        path: Path = tmp_path / name
        write(path, messages)
        return path

    return to_file


def test_odometry_is_composed_with_the_mounting_and_interpolated(written):
    recording = open_recording(written(drive()))
    assert recording.T_base_sensor == pytest.approx([0.2, 0.1, math.pi / 2])
    scans = list(recording)
    assert len(scans) == 10
    for index, (scan, t) in enumerate(zip(scans, np.linspace(0.02, 0.92, 10), strict=True)):
        assert scan.stamp == pytest.approx(100 + t, abs=1e-6)
        assert scan.odometry == pytest.approx([t + 0.2, 0.1, math.pi / 2], abs=1e-6), index
        np.testing.assert_allclose(scan.ranges[:11], np.float32(1 + t + np.arange(11)))
        assert np.isnan(scan.ranges[11:]).all()


def test_headings_are_interpolated_across_the_half_turn(written):
    messages = [
        ("/odom", "nav_msgs/Odometry", odometry(1.0, 0, 0, 3.1), 1.0),
        ("/odom", "nav_msgs/Odometry", odometry(2.0, 0, 0, -3.1), 2.0),
        ("/scan", LASER, laser(1.5, np.ones(13), "base_link"), 1.5),
    ]
    (scan,) = open_recording(written(messages))
    assert abs(scan.odometry[2]) == pytest.approx(math.pi)


def test_a_clockwise_scan_is_turned(written):
    ranges = np.arange(1.0, 9.0)
    turned = laser(
        1, ranges, angle_min=1.0, angle_increment=-0.25, time_increment=0.01, intensities=list(ranges)
    )
    recording = open_recording(written([("/scan", LASER, turned, 1.0)]))
    (scan,) = recording
    for bearing, range_, quality, time in zip(
        scan.bearings, scan.ranges, scan.quality, scan.beam_times, strict=True
    ):
        index = range_ - 1
        assert bearing == pytest.approx(1.0 - 0.25 * index)
        assert quality == range_
        assert time == pytest.approx(0.01 * index)
    assert (np.diff(scan.bearings) > 0).all()
    assert "1 scan that ran clockwise, turned." in recording.notes


def test_a_sensor_upside_down_is_mirrored(written):
    """Seen from above, its left is right: a beam at +0.5 rad points where base yaw - 0.5 rad does."""
    mounting = transform("base_link", "laser", 0.1, 0.0, quaternion(roll=math.pi, yaw=0.3))
    scan_message = laser(1, [2.0], angle_min=0.5)
    messages = [("/tf_static", TF, mounting, 0.0), ("/scan", LASER, scan_message, 1.0)]
    recording = open_recording(written(messages))
    assert recording.T_base_sensor == pytest.approx([0.1, 0, 0.3])
    (scan,) = recording
    assert scan.bearings == pytest.approx([-0.5])
    assert any("upside down" in note for note in recording.notes)


def test_the_chain_of_frames_is_followed(written):
    messages = [
        ("/tf", TF, transform("odom", "base_link", 5.0, 5.0, quaternion(yaw=1.0)), 0.0),
        ("/tf_static", TF, transform("base_link", "mast", 1.0, 0.0, quaternion(yaw=math.pi / 2)), 0.0),
        ("/tf_static", TF, transform("mast", "laser", 0.5, 0.0, quaternion(yaw=math.pi / 2)), 0.0),
        ("/scan", LASER, laser(1, np.ones(5)), 1.0),
    ]
    assert open_recording(written(messages)).T_base_sensor == pytest.approx([1.0, 0.5, math.pi])


def test_a_loop_of_frames_does_not_hang(written):
    messages = [
        ("/tf_static", TF, transform("a", "laser", 1.0, 0.0, quaternion()), 0.0),
        ("/tf_static", TF, transform("laser", "a", 1.0, 0.0, quaternion()), 0.0),
        ("/scan", LASER, laser(1, np.ones(5)), 1.0),
    ]
    assert len(list(open_recording(written(messages)))) == 1


def test_a_lidar_is_chosen_by_its_topic(written):
    messages = [
        ("/front", LASER, laser(1, np.full(5, 2.0)), 1.0),
        ("/rear", LASER, laser(1, np.full(5, 3.0)), 1.0),
    ]
    path = written(messages)
    with pytest.raises(TopicError) as caught:
        open_recording(path)
    assert caught.value.topics == ("/front", "/rear")
    (scan,) = open_recording(path, "/rear")
    assert set(scan.ranges) == {3.0}


def test_zero_stamps_are_replaced_by_the_time_of_recording(written):
    recording = open_recording(written([("/scan", LASER, laser(0, np.ones(5)), 7.5)]))
    (scan,) = recording
    assert scan.stamp == pytest.approx(7.5)
    assert any("time of recording" in note for note in recording.notes)


def test_markers_for_no_return_are_missing(written):
    ranges = [0.0, math.inf, -math.inf, math.nan, 0.05, 12.0, 12.5, 11.9, 0.11]
    (scan,) = open_recording(written([("/scan", LASER, laser(1, ranges), 1.0)]))
    np.testing.assert_array_equal(scan.ranges, [*[math.nan] * 7, *np.float32([11.9, 0.11])])


@pytest.mark.parametrize(
    "fields",
    [{"angle_increment": 1.0, "angle_min": -180.0}, {"angle_increment": 0.0}, {"angle_min": math.nan}],
)
def test_angles_that_make_no_sense_are_refused(written, fields):
    path = written([("/scan", LASER, laser(1, np.ones(361), **fields), 1.0)])
    with pytest.raises(RecordingError, match=r"no readable scan.*1 damaged scan left out"):
        list(open_recording(path))


def test_a_bag_without_a_lidar_says_what_it_holds(written):
    path = written([("/odom", "nav_msgs/Odometry", odometry(1, 0, 0, 0), 1.0)])
    with pytest.raises(RecordingError, match=r"/odom \(nav_msgs/Odometry\)"):
        open_recording(path)
