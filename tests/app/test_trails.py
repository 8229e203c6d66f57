"""Trails of long drives: they begin where the drive began, and never grow beyond their bound."""

import numpy as np
from lidarcore_app.pipeline.trails import MOST, STEP, Trail


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
