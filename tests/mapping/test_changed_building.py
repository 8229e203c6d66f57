"""Localizing a real TurtleBot in the map that slam_toolbox made of the floor on another day, with people about."""

import gzip
import shutil
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from lidarcore import open_recording
from lidarcore.geometry import pose_difference, relative
from lidarcore.localization import TrackingResult
from lidarcore.mapping import MapPicture, WholeScans
from lidarcore.mapping.grid import read_ros_map
from lidarcore.scan import Array, Scan

pytestmark = pytest.mark.real_data

BEGIN = [6.84, -8.41, 3.351]
"""Where nine in ten of the first scan's points lie within 10 cm of what the map has: nowhere else do six in ten."""
NEAR = np.diag([0.2, 0.2, 0.15]) ** 2


@pytest.fixture(scope="module")
def floor(data: Path, tmp_path_factory: pytest.TempPathFactory) -> MapPicture:
    folder, name = tmp_path_factory.mktemp("floor"), "mac_1st_floor_final"
    packed = data / "turtlebot4_rplidar_rosbag2"
    shutil.copyfile(packed / f"{name}.yaml", folder / f"{name}.yaml")
    (folder / f"{name}.pgm").write_bytes(gzip.decompress((packed / f"{name}.pgm.gz").read_bytes()))
    return MapPicture(read_ros_map(folder / f"{name}.yaml"))


@pytest.fixture(scope="module")
def scans(data: Path) -> list[Scan]:
    return list(open_recording(data / "turtlebot4_rplidar_rosbag2" / "macfirst_floor_take_2"))


def followed(floor: MapPicture, scans: list[Scan], told: ArrayLike | None = None) -> list[TrackingResult]:
    with closing(WholeScans(known=floor, background=False)) as tracker:
        if told is not None:
            tracker.place(told, NEAR)
        return [tracker.step(tracker.deskewed(scan)) for scan in scans]


def against_wheels(results: list[TrackingResult], scans: list[Scan]) -> Array:
    """(N, 3) by how much the poses differ from the way that the wheels tell since the first scan that has both.

    The robot stands there. Its wheels are 0.16 s late, which makes 0.16 rad where it turns fastest.
    """
    pairs = [
        (one.estimate.pose, scan.odometry)
        for one, scan in zip(results, scans, strict=True)
        if scan.odometry is not None
    ]
    poses, wheels = (np.array(column) for column in zip(*pairs, strict=True))
    return pose_difference(relative(wheels[0], wheels), relative(poses[0], poses))


def test_the_drive_is_found_without_a_guess_and_tracked_once_it_is_confirmed(floor, scans):
    results = followed(floor, scans)
    states = [one.state for one in results]
    first = states.index("tracking")
    assert np.hypot(*pose_difference(BEGIN, results[0].estimate.pose)[:2]) < 0.15
    assert set(states[:first]) == {"coasting"}  # it turns on the spot for 20 s; a metre has to be driven
    assert states[first:].count("tracking") > 0.9 * len(states[first:])
    off = against_wheels(results, scans)
    assert np.hypot(*off[:, :2].T).max() < 0.3
    assert np.abs(off[:, 2]).max() < 0.2


def test_where_someone_says_it_is_it_is_tracked_at_once(floor, scans):
    results = followed(floor, scans, BEGIN)
    assert [one.state for one in results].count("tracking") > 0.85 * len(results)
    off = against_wheels(results, scans)
    assert np.hypot(*off[:, :2].T).max() < 0.3


@pytest.mark.parametrize("told", [[7.84, -8.41, 3.351], [6.84, -8.41, 0.209], [10.0, -25.0, 1.0]])
def test_where_someone_is_wrong_it_is_not_tracked_there(floor, scans, told):
    """The end is where the drive that was found without a guess ends."""
    results = followed(floor, scans, told)
    tracked = [one.state == "tracking" for one in results]
    assert not any(tracked[:100])
    assert tracked[-1]
    assert np.hypot(*(results[-1].estimate.pose[:2] - [9.05, -13.98])) < 0.15
