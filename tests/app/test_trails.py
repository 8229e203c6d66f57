"""Trails of long drives: they begin where the drive began, and never grow beyond their bound."""

import numpy as np
import pytest
from lidarcore_app.pipeline.settings import LiveNavigation
from lidarcore_app.pipeline.slam_run import Run
from lidarcore_app.pipeline.trails import MOST, STEP, Trail, Trails

from lidarcore.mapping import WholeScans
from lidarcore.mapping.live.background import Corrected


def test_a_long_way_is_kept_whole_and_evenly_in_a_bounded_number_of_points():
    way = np.arange(3 * MOST) * 1.5 * STEP
    trail = Trail()
    for x in way:
        trail.add(np.array([x, 2.0]))
        assert len(trail.points) <= MOST + 1
    np.testing.assert_array_equal(trail.points[0], [way[0], 2.0])
    np.testing.assert_array_equal(trail.points[-1], [way[-1], 2.0])
    gaps = np.diff(trail.points[:, 0])
    assert 0 < gaps.max() <= 2 * gaps.min()


def test_a_sensor_that_stands_still_or_has_no_pose_adds_nothing():
    trail = Trail()
    for xy in ([0.0, 0.0], [0.5 * STEP, 0.0], [np.nan, 0.0], [0.0, 2 * STEP]):
        trail.add(np.array(xy))
    np.testing.assert_array_equal(trail.points, [[0.0, 0.0], [0.0, 2 * STEP]])


@pytest.mark.parametrize("keyframes", [1, 2, MOST, MOST + 1, 12_000, 12_001])
def test_of_a_long_way_through_a_map_a_bounded_number_of_points_is_drawn(keyframes: int):
    navigator = WholeScans()
    way = np.column_stack([0.3 * np.arange(keyframes), np.full(keyframes, 2.0), np.zeros(keyframes)])
    navigator._background.corrected = Corrected(keyframes, way, np.zeros((3, 3)))
    drawn = Run(0, LiveNavigation(), navigator, None, None, Trails(own_frame=True)).paths.estimated
    navigator.close()
    assert min(keyframes, MOST / 2) <= len(drawn) <= MOST + 1
    np.testing.assert_array_equal(drawn[[0, -1]], way[[0, -1], :2])
    gaps = np.diff(drawn[:, 0])
    assert (gaps > 0).all()
    np.testing.assert_allclose(gaps[:-1], gaps[:1].repeat(max(len(gaps) - 1, 0)))
