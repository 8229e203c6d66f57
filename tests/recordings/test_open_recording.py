import gzip
import json
import os
import shutil
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from real_recordings import each, where

from lidarcore.errors import RecordingError, TopicError
from lidarcore.files.streams import read_head
from lidarcore.mapping.grid import build_grid, write_ros_map
from lidarcore.recordings import FORMATS, open_recording
from lidarcore.scan import Scan

RECORDINGS = {
    "breezyslam_mines_urg/exp2.dat.gz": "CoreSLAM log",
    "brenner_lego_arena_groundtruth/robot4_scan.txt": "LEGO robot log",
    "ccny_hokuyo_rosbag1/demo.bag": "ROS 1 bag",
    "rplidar_rosbag1/lidar.bag": "ROS 1 bag",
    "turtlebot4_rplidar_rosbag2/macfirst_floor_take_2": "ROS 2 bag",
    "turtlebot4_rplidar_rosbag2/macfirst_floor_take_2/macfirst_floor_take_2_0.db3": "ROS 2 bag",
    "carmen_radish_corrected/aces-corrected.log.gz": "CARMEN log",
    "carmen_radish_corrected/belgioioso-corrected.log.gz": "CARMEN log",
    "carmen_radish_corrected/freiburg-101-corrected.log.gz": "CARMEN log",
    "carmen_radish_corrected/intel-corrected.log.gz": "CARMEN log",
    "rplidar_csv_rooms/golf_room.csv.gz": "RPLIDAR CSV",
    "rplidar_csv_rooms/mapping_keng.csv.gz": "RPLIDAR CSV",
    "rplidar_csv_rooms/nut_behind_obj.csv.gz": "RPLIDAR CSV",
    "rplidar_csv_rooms/nut_room.csv.gz": "RPLIDAR CSV",
    "rplidar_raw_serial_hex/frame_grabber_Data.txt": "SLAMTEC text dump",
    "rplidar_raw_serial_hex/realterm_capture_1.txt": "RPLIDAR hex dump",
    "rplidar_raw_serial_hex/sample_data_2.txt": "RPLIDAR hex dump",
    "rplidar_raw_serial_hex/sample_data_motorctrl_1st_try.txt": "RPLIDAR hex dump",
    "rplidar_raw_serial_hex/sample_data_pyserial_1.txt.gz": "RPLIDAR hex dump",
    "rplidar_raw_serial_hex/sample_data_pyserial_3.txt": "RPLIDAR hex dump",
    "slambot_rplidar_a1_encoders/data_24JUL14_14m.log.gz": "SLAMbot log",
    "windsor_rplidar_mat/scans_a.mat": "MATLAB .mat",
    "windsor_rplidar_mat/scans_b.mat": "MATLAB .mat",
    "tau_rplidar_c1_rooms/lab446__scans.json": "JSON point sets",
    "tau_rplidar_c1_rooms/lab446__scans.old.json": "JSON point sets",
    "intel_odometry_groundtruth/intel_scans_odom_corrected.csv.gz": "CSV table of scans",
    "mrpt_sena_sick/localization_demo.csv.gz": "CSV table of scans",
    "mrpt_sena_sick/sena_telecom_one_loop.csv.gz": "CSV table of scans",
}


OTHERS = [
    "brenner_lego_arena_groundtruth/robot_arena_landmarks.txt",
    "brenner_lego_arena_groundtruth/robot4_motors.txt",
    "intel_odometry_groundtruth/intel.relations.gz",
    "tau_rplidar_c1_rooms/LICENSE",
    "tau_rplidar_c1_rooms/NOTE.txt",
    "tau_rplidar_c1_rooms/lab446__circle1.json",
    "tau_rplidar_c1_rooms/lab446__transforms.json",
    "turtlebot4_rplidar_rosbag2/mac_1st_floor_final.pgm.gz",
    "turtlebot4_rplidar_rosbag2/macfirst_floor_take_2/metadata.yaml",
]


def formats_of(path):
    head = b"" if path.is_dir() else read_head(path)
    return [format_.name for format_ in FORMATS if format_.recognises(path, head)]


@pytest.mark.parametrize("name", each(RECORDINGS))
def test_a_recording_is_of_one_format(name):
    assert formats_of(where(name)) == [RECORDINGS[name]]


@pytest.mark.parametrize("name", each(OTHERS))
def test_what_lies_beside_recordings_is_of_none(name):
    assert formats_of(where(name)) == []


@pytest.mark.parametrize("name", each(RECORDINGS))
def test_every_recording_yields_the_same_sound_scans_each_time(name):
    topic = "dev1" if name.endswith(".json") else None
    recording = open_recording(where(name), topic)
    first = list(recording)
    notes = recording.notes
    again = list(recording)
    assert len(first) == len(again) > 0
    assert recording.notes == notes
    for scan, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(scan.ranges, other.ranges)
        assert np.isfinite(scan.bearings).all()
        assert np.isfinite(scan.stamp)
        assert not (scan.ranges <= 0).any()
        assert not np.isinf(scan.ranges).any()


def test_content_decides_not_the_name(data, tmp_path):
    renamed = tmp_path / "scan.txt"
    shutil.copy(data / "rplidar_rosbag1/lidar.bag", renamed)
    assert open_recording(renamed).name == "ROS 1 bag"


@pytest.mark.parametrize(
    "name", each(name for name in RECORDINGS if "rosbag2" not in name and not name.endswith("gz"))
)
def test_packed_files_read_as_the_unpacked(tmp_path, name):
    packed = tmp_path / "packed"
    packed.write_bytes(gzip.compress(where(name).read_bytes(), 1))
    topic = "dev1" if name.endswith(".json") else None
    for scan, other in zip(open_recording(packed, topic), open_recording(where(name), topic), strict=True):
        np.testing.assert_array_equal(scan.ranges, other.ranges)
        np.testing.assert_array_equal(scan.bearings, other.bearings)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda folder: folder / "missing.bag", "There is no file"),
        (lambda folder: folder / "zero\0byte", "There is no file"),
        (lambda folder: folder / ("long" * 200), "cannot be opened"),
        (lambda folder: folder, "is not a ROS 2 bag"),
        (lambda folder: Path("/dev/zero"), "There is no file at .* but a device or a pipe: save"),
        (lambda folder: written(folder / "empty.bag", b""), "is empty"),
        (lambda folder: written(folder / "unpacks_to_nothing.gz", gzip.compress(b"")), "is empty"),
        (
            lambda folder: written(folder / "letter.txt", b"Dear robot,\n"),
            "saved with numpy.savez as a .npz: ranges",
        ),
        (lambda folder: zipped_bag(folder / "drive.zip"), "a zip of other files.*unpack it.*ROS 2 bag"),
        (lambda folder: ros_map(folder / "hall.yaml"), "hall.yaml looks like a map.*Map › Load a file"),
        (
            lambda folder: ros_map(folder / "hall.yaml").with_suffix(".pgm"),
            "hall.pgm looks like a map.* load the .yaml that belongs to it in the page",
        ),
        (
            lambda folder: packed(ros_map(folder / "hall.yaml").with_suffix(".pgm")),
            "hall.pgm.gz looks like a map.* unpack it, and load the .yaml that belongs to it",
        ),
        (lambda folder: fifo(folder / "pipe"), "There is no file at .* but a device or a pipe: save"),
    ],
)
def test_what_is_no_recording_gets_a_clear_error(tmp_path, make, text):
    with pytest.raises(RecordingError, match=text):
        open_recording(make(tmp_path))


def written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def zipped_bag(path: Path) -> Path:
    demo = Path(__file__).parents[2] / "app" / "demo" / "emulated-s1.mcap"
    with ZipFile(path, "w") as archive:
        archive.writestr("drive/metadata.yaml", "rosbag2_bagfile_information:\n")
        archive.write(demo, "drive/drive_0.mcap")
    return path


def packed(path: Path) -> Path:
    """The file, packed beside it."""
    beside = path.with_name(f"{path.name}.gz")
    beside.write_bytes(gzip.compress(path.read_bytes()))
    return beside


def ros_map(path: Path) -> Path:
    write_ros_map(build_grid([Scan([2.0, 3.0], [0.0, 0.1])], np.zeros((1, 3))), path)
    return path


def fifo(path: Path) -> Path:
    os.mkfifo(path)
    return path


def test_the_error_for_an_unknown_file_lists_the_formats(tmp_path):
    with pytest.raises(RecordingError) as caught:
        open_recording(written(tmp_path / "letter.txt", b"Dear robot,\n"))
    assert all(format_.name in str(caught.value) for format_ in FORMATS)


def test_of_several_lidars_one_must_be_chosen(shipped):
    path = shipped / "tau_rplidar_c1_rooms/lab446__scans.json"
    with pytest.raises(TopicError) as caught:
        open_recording(path)
    assert caught.value.topics == ("dev1", "dev2", "dev3", "dev4", "dev5")
    assert open_recording(path, "dev3").topic == "dev3"
    with pytest.raises(TopicError, match="dev9"):
        open_recording(path, "dev9")


def test_a_topic_is_refused_where_there_are_none(shipped):
    with pytest.raises(TopicError, match="no topics"):
        open_recording(shipped / "windsor_rplidar_mat/scans_a.mat", "/scan")


def test_point_sets_keep_their_points(shipped):
    path = shipped / "tau_rplidar_c1_rooms/lab446__scans.json"
    points = np.array(json.loads(path.read_text())["dev2"])
    (scan,) = open_recording(path, "dev2")
    found, expected = (np.array(sorted(map(tuple, xy))) for xy in (scan.xy, points))
    np.testing.assert_allclose(found, expected, atol=1e-12)
