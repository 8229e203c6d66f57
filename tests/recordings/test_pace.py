"""How far apart in time scans are taken to be where a file does not say."""

import numpy as np
import pytest

from lidarcore.evaluation.maps.honesty import drive
from lidarcore.evaluation.maps.study import prepared, study
from lidarcore.mapping import MapperSettings
from lidarcore.recordings import open_recording
from lidarcore.recordings.pace import NOMINAL_PERIOD, period

BELGIOIOSO = "carmen_radish_corrected/belgioioso-corrected.log.gz"


@pytest.mark.parametrize("world", ["office", "two rooms", "corridor"])
@pytest.mark.parametrize("kept", [5, 10, 20])
def test_scans_of_a_simulated_robot_come_about_as_often_as_its_way_tells(world, kept):
    """It drives at up to .8 m/s and turns at up to 1 rad/s, and a log keeps a scan for every half to two seconds."""
    scans = drive(world, 60, seed=3)[::kept]
    true = scans[1].stamp - scans[0].stamp
    assert true / 2.5 < period(np.array([scan.truth for scan in scans])) < 1.5 * true


def test_turning_on_the_spot_takes_time_as_well():
    headings = 0.4 * np.arange(30)
    assert period(np.stack([0 * headings, 0 * headings, headings], -1)) == pytest.approx(0.4)


def test_a_sensor_that_stands_has_the_nominal_period():
    assert period(np.zeros((10, 3))) == period(np.zeros((1, 3))) == period(np.empty((0, 3))) == NOMINAL_PERIOD


def test_poses_that_jump_or_are_not_there_hardly_count():
    poses = np.zeros((101, 3))
    poses[:, 0] = 0.5 * np.arange(101)
    poses[50] = np.nan
    poses[80:, 0] += 30000.0
    assert period(poses) == pytest.approx(0.5, abs=0.05)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf, 1e308])
def test_poses_that_are_no_places_are_no_error(odd):
    poses = np.zeros((20, 3))
    poses[1::2] = odd
    assert NOMINAL_PERIOD <= period(poses) <= 2.0
    assert period(np.full((3, 3), odd)) >= NOMINAL_PERIOD


@pytest.mark.real_data
def test_a_real_log_without_times_or_odometry_tells_of_no_robot_of_five_metres_a_second(data):
    """Taken to come ten times a second, 30 of its first 150 scans lay nowhere, and 43 % of the poses told at once were
    what they claimed."""
    scans, reference = prepared(list(open_recording(data / BELGIOIOSO))[:150], "none", 0)
    steps = np.diff(reference[:, :2], axis=0)
    speed = np.hypot(*steps.T).sum() / (scans[-1].stamp - scans[0].stamp)
    assert speed < 1.0
    found = study(scans, reference, MapperSettings())
    assert found.tracked == 150
    assert found.wrong == 0
    assert np.mean(found.live < 7.81) > 0.93
