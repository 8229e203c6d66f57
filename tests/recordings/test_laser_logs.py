import gzip
import math
from itertools import pairwise

import numpy as np
import pytest

from lidarcore.errors import RecordingError, TopicError
from lidarcore.recordings import open_recording

CARMEN = "carmen_radish_corrected"


def flasers(path):
    """FLASER lines, split at spaces by nothing but str.split."""
    lines = gzip.decompress(path.read_bytes()).decode().split("\n")
    return [line.split() for line in lines if line.startswith("FLASER ")]


def assert_same_pose(pose, expected):
    """To the six digits of the logs; headings may differ by whole turns."""
    assert pose[:2] == pytest.approx(expected[:2], abs=1e-5)
    assert math.remainder(pose[2] - expected[2], 2 * math.pi) == pytest.approx(0, abs=1e-5)


@pytest.mark.parametrize(
    ("name", "scans", "beams", "step", "marker"),
    [
        ("aces", 440, 180, 1.0, 50.0),
        ("belgioioso", 395, 361, 0.5, 80.0),
        ("freiburg-101", 292, 360, 0.5, 80.0),
        ("intel", 910, 180, 1.0, 80.0),
    ],
)
def test_carmen_logs_read_as_their_lines(data, name, scans, beams, step, marker):
    path = data / CARMEN / f"{name}-corrected.log.gz"
    read, lines = list(open_recording(path)), flasers(path)
    if name == "intel":  # four of its lines were written late
        lines.sort(key=lambda words: float(words[-3]))
    assert len(read) == len(lines) == scans
    for scan, words in zip(read, lines, strict=True):
        assert int(words[1]) == len(scan) == beams
        ranges = np.array(words[2 : 2 + beams], float)
        np.testing.assert_array_equal(scan.ranges, np.where(ranges >= marker, np.nan, ranges))
        np.testing.assert_allclose(np.degrees(scan.bearings), -90 + step * np.arange(beams), atol=1e-9)
        assert_same_pose(scan.odometry, np.array(words[-9:-6], float))


def test_stamps_are_kept_where_they_grow(data):
    path = data / CARMEN / "freiburg-101-corrected.log.gz"
    assert [scan.stamp for scan in open_recording(path)] == [float(words[-3]) for words in flasers(path)]


def test_rounded_stamps_give_way_to_the_order_of_the_file(data):
    path = data / CARMEN / "belgioioso-corrected.log.gz"
    assert len({words[-3] for words in flasers(path)}) < 10
    recording = open_recording(path)
    x, y, headings = np.array([words[-9:-6] for words in flasers(path)], float).T
    seconds = np.maximum(np.hypot(np.diff(x), np.diff(y)), np.abs(np.diff(np.unwrap(headings)))).mean()
    assert [scan.stamp for scan in recording] == pytest.approx(round(seconds, 2) * np.arange(395))
    assert any("zero or rounded" in note and f"{seconds:.2f} s apart" in note for note in recording.notes)


def test_stamps_of_zero_in_a_log_of_a_robot_that_stands_give_way_to_ten_scans_a_second(tmp_path):
    scans = open_recording(log(tmp_path, *(flaser(0) for _ in range(4))))
    assert [scan.stamp for scan in scans] == pytest.approx([0.0, 0.1, 0.2, 0.3])


def test_lines_that_were_written_late_are_put_in_their_order(tmp_path):
    """Each is at most as many lines late as one of them; ranges and poses stay with their stamps."""
    order = [0, 2, 1, 3, 6, 4, 7, 5, 8, 9, 12, 11, 10]
    lines = [flaser(100 + k, pose=f"{k} 2 0.5 {k} 2 0.5") for k in order]
    recording = open_recording(log(tmp_path, *lines))
    scans = list(recording)
    assert [scan.stamp for scan in scans] == [100 + k for k in range(13)]
    assert [scan.odometry[0] for scan in scans] == list(range(13))
    assert "The stamps go back in time 5 times: scans are put in their order." in recording.notes
    assert [scan.stamp for scan in recording] == [scan.stamp for scan in scans]


def test_a_clock_that_was_set_back_leaves_the_order_of_the_lines(tmp_path):
    stamps = [*range(200), *range(50, 250)]
    recording = open_recording(log(tmp_path, *map(flaser, stamps)))
    assert [scan.stamp for scan in recording] == stamps
    assert "The stamps go back in time once." in recording.notes


def test_corrected_poses_are_noted(data):
    for path in (data / CARMEN).glob("*.gz"):
        assert any("corrected" in note for note in open_recording(path).notes)


def test_a_wall_seen_by_carmen_lies_where_its_poses_put_it(data):
    """Corrected poses and ccw bearings from the right make a sharp map; mirrored bearings do not."""
    scans = list(open_recording(data / CARMEN / "intel-corrected.log.gz"))[:150]

    def cells(sign):
        seen = set()
        for scan in scans:
            x, y, heading = scan.odometry
            near = scan.valid & (np.nan_to_num(scan.ranges, nan=99) < 8)
            angles = heading + sign * scan.bearings[near]
            world = scan.ranges[near, None] * np.stack([np.cos(angles), np.sin(angles)], -1) + [x, y]
            seen |= set(map(tuple, np.floor(world / 0.1).astype(int)))
        return len(seen)

    assert cells(1) < 0.7 * cells(-1)


RANGES = " ".join(f"{2 + 0.01 * index:.2f}" for index in range(180))


def log(tmp_path, *lines):
    path = tmp_path / "a.log"
    path.write_text("".join(f"{line}\n" for line in lines))
    return path


def flaser(stamp, pose="1 2 0.5 1 2 0.5", ranges=RANGES, count=180, logger=None):
    return f"FLASER {count} {ranges} {pose} {stamp} host {stamp if logger is None else logger}"


def robotlaser(kind="ROBOTLASER1", poses="1.0 2.5 1.5707963 1.0 2.0 1.5707963 0 0 0.1 0.1 0 ", stamp=5.0):
    return f"{kind} 0 -0.5 1.0 0.5 8.0 0.01 1 3 1.0 8.0 3.0 3 10 20 30 {poses}{stamp} host {stamp}"


def test_robotlaser_lines_say_their_geometry(tmp_path):
    recording = open_recording(log(tmp_path, robotlaser()))
    (scan,) = recording
    np.testing.assert_array_equal(scan.ranges, [1.0, math.nan, 3.0])
    assert scan.bearings == pytest.approx([-0.5, 0.0, 0.5])
    assert list(scan.quality) == [10, 20, 30]
    assert scan.stamp == 5.0
    assert recording.T_base_sensor == pytest.approx([0.5, 0, 0], abs=1e-5)
    assert scan.odometry == pytest.approx([1.0, 2.5, 1.5707963])


def test_raw_lasers_take_their_pose_from_the_odometry_lines(tmp_path):
    recording = open_recording(
        log(
            tmp_path,
            "PARAM robot_frontlaser_offset 0.3 host 0",
            "ODOM 0 0 1.5707963 0 0 0 4.0 host 4.0",
            "ODOM 0 2 1.5707963 0 0 0 6.0 host 6.0",
            robotlaser("RAWLASER1", ""),
        )
    )
    (scan,) = recording
    assert recording.T_base_sensor == pytest.approx([0.3, 0, 0])
    assert scan.odometry == pytest.approx([0, 1.3, 1.5707963], abs=1e-6)


def test_one_laser_logged_raw_and_with_pose_is_one(tmp_path):
    recording = open_recording(log(tmp_path, robotlaser("RAWLASER1", ""), robotlaser()))
    assert recording.topics == ("ROBOTLASER1",)
    assert len(list(recording)) == 1


def test_front_and_rear_laser_are_to_be_chosen(tmp_path):
    path = log(
        tmp_path,
        flaser(1, "1.2 2 0 1 2 0"),
        flaser(1, "0.7 2 3.141593 1 2 0").replace("FLASER", "RLASER"),
        flaser(2, "0.7 2 3.141592 1 2 0").replace("FLASER", "RLASER"),
        flaser(2, "1.2 2 0 1 2 0"),
    )
    with pytest.raises(TopicError) as caught:
        open_recording(path)
    assert caught.value.topics == ("FLASER", "RLASER")
    rear = open_recording(path, "RLASER")
    assert_same_pose(rear.T_base_sensor, [-0.3, 0, math.pi])
    for scan in rear:
        assert_same_pose(scan.odometry, [0.7, 2, math.pi])


def test_a_corrected_sensor_pose_is_not_taken_for_odometry(tmp_path):
    lines = [flaser(1, "1 2 0 1 2 0"), flaser(2, "5 6 0.3 2 2 0")]
    recording = open_recording(log(tmp_path, "PARAM robot_frontlaser_offset 0.1 host 0", *lines))
    assert [scan.odometry[0] for scan in recording] == pytest.approx([1.1, 2.1])
    assert any("corrected" in note for note in recording.notes)


def test_poses_of_a_graph_are_odometry_that_is_told_of(tmp_path):
    lines = [robotlaser(stamp=float(k)) for k in range(3)]
    graph = log(tmp_path, "VERTEX2 0 1.0 2.0 1.5", lines[0], "EDGE2 0 1 0.5 0 0 1 0 1 1 0 0", *lines[1:])
    scans = list(recording := open_recording(graph))
    assert [note for note in recording.notes if "pose graph (VERTEX lines)" in note]
    assert all(scan.odometry is not None and scan.truth is None for scan in scans)
    plain = open_recording(log(tmp_path, *lines))
    assert not [note for note in plain.notes if "pose graph" in note]


def test_logger_stamps_help_where_the_others_are_rounded(tmp_path):
    lines = [flaser("1.01893e+09", logger=0.2 * index) for index in range(5)]
    assert [scan.stamp for scan in open_recording(log(tmp_path, *lines))] == pytest.approx(0.2 * np.arange(5))


def test_a_far_reading_that_is_no_marker_is_kept(tmp_path):
    """The same range 20 times among others like it is a wall, not a marker."""
    ranges = " ".join(["7.50"] * 20 + ["7.45"] * 60 + ["3.00"] * 100)
    (scan,) = open_recording(log(tmp_path, flaser(1, ranges=ranges)))
    assert scan.valid.all()


def test_damaged_lines_are_left_out_and_counted(tmp_path):
    lines = [
        flaser(1),
        "FLASER 180 1 2 3",
        "FLASER many 1",
        flaser(2, ranges=RANGES.replace("2.50", "2.5O")),
        flaser(3),
    ]
    recording = open_recording(log(tmp_path, *lines, "FLASER -5 1 2", "FLASER 4000000000 1 2"))
    assert [scan.stamp for scan in recording] == [1, 3]
    assert "5 damaged lines left out." in recording.notes


def test_unusual_numbers_of_beams_are_noted(tmp_path):
    recording = open_recording(log(tmp_path, flaser(1, ranges="1 2 3 4 5", count=5)))
    (scan,) = recording
    assert np.degrees(scan.bearings) == pytest.approx([-90, -45, 0, 45, 90])
    assert any("5 beams are taken to span 180 degrees" in note for note in recording.notes)


def test_a_log_without_lasers_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="no readable laser line"):
        open_recording(log(tmp_path, "ODOM 0 0 0 0 0 0 4.0 host 4.0"))


def test_gfs_streams_give_the_odometry_of_their_readings(tmp_path):
    path = log(
        tmp_path,
        "PARAM maxrange 80",
        "ODOM 576.537 0.107 -2.255213 1134864629.895182",
        "ODO_UPDATE 1 0.000 0.000 0.000000 0.000000 1134864629.895182",
        f"LASER_READING 180 {RANGES.replace('2.10', '81.91')} 1.5 2.5 0.25 1134864630.5",
        "SM_UPDATE 1 0.1 0.2 0.3 0.0",
        f"LASER_READING 180 {RANGES} 2.5 2.5 0.25 1134864631.5",
    )
    recording = open_recording(path)
    assert recording.name == "GMapping .gfs"
    first, second = recording
    assert second.stamp - first.stamp == pytest.approx(1.0)
    assert first.odometry == pytest.approx([1.5, 2.5, 0.25])
    assert np.isnan(first.ranges[10])
    np.testing.assert_array_equal(np.delete(first.ranges, 10), np.delete(second.ranges, 10))


def test_tables_of_scans_give_raw_odometry(data):
    path = data / "intel_odometry_groundtruth/intel_scans_odom_corrected.csv.gz"
    table = np.array(
        [row.split(",") for row in gzip.decompress(path.read_bytes()).decode().split()[1:]], float
    )
    recording = open_recording(path)
    for scan, row in zip(recording, table, strict=True):
        assert scan.stamp == row[0]
        np.testing.assert_array_equal(scan.odometry, row[1:4])
        np.testing.assert_array_equal(scan.ranges, np.where(row[7:] >= 80, np.nan, row[7:]))


def test_the_marker_of_a_table_of_scans_is_missing(data):
    scans = list(open_recording(data / "mrpt_sena_sick/sena_telecom_one_loop.csv.gz"))
    assert len(scans) == 225
    assert np.median(np.concatenate([scan.ranges[scan.valid] for scan in scans])) == pytest.approx(
        8.6, abs=0.1
    )
    path = sum(math.dist(a.odometry[:2], b.odometry[:2]) for a, b in pairwise(scans))
    assert path == pytest.approx(76.4, abs=0.2)


def table(path, names, *, beams=360):
    """A CSV table of two scans, with columns of these names besides."""
    header = ",".join(["t", *names, *(f"r{k}" for k in range(beams))])
    rows = (",".join(map(str, [t, *names.values(), *[2.0] * beams])) for t in (0.0, 0.1))
    path.write_text("\n".join([header, *rows]) + "\n")
    return open_recording(path)


def test_a_table_without_angles_says_what_it_is_taken_for(tmp_path):
    recording = table(tmp_path / "bare.csv", {})
    assert "The log gives no angles: 360 beams are taken to span 179.5 degrees." in recording.notes
    assert np.ptp(next(iter(recording)).bearings) == pytest.approx(math.radians(179.5))


def test_a_table_may_give_its_angles(tmp_path):
    step = math.tau / 360
    recording = table(tmp_path / "turn.csv", {"angle_min": -math.pi, "angle_increment": step})
    assert not any("angles" in note for note in recording.notes)
    np.testing.assert_allclose(next(iter(recording)).bearings, -math.pi + step * np.arange(360))


def test_poses_that_a_log_declares_corrected_are_its_truth(data):
    corrected = next(iter(open_recording(data / CARMEN / "intel-corrected.log.gz")))
    np.testing.assert_array_equal(corrected.truth, corrected.odometry)
