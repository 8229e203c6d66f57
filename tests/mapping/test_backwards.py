"""Real recordings turned around in time: drives through the same rooms that no setting was chosen on."""

import numpy as np
import pytest
from scipy.stats import chi2

from lidarcore import Scan, open_recording
from lidarcore.evaluation.maps.accuracy import backwards
from lidarcore.evaluation.maps.study import prepared, study
from lidarcore.mapping import MapperSettings

TURTLEBOT = "turtlebot4_rplidar_rosbag2/macfirst_floor_take_2"


def judged(scans, odometry):
    return study(*prepared(scans, odometry, 0), MapperSettings())


@pytest.mark.real_data
@pytest.mark.parametrize("odometry", ["recorded", "none"])
def test_a_turning_rplidar_knows_where_it_is_the_other_way_round_too(data, odometry):
    """Its beams come before their stamps then, and its odometry lags behind."""
    found = judged(backwards(list(open_recording(data / TURTLEBOT))), odometry)
    assert found.tracked == found.scans
    assert np.mean(found.live_by_map < chi2(3).ppf(0.95)) > 0.95


@pytest.mark.real_data
def test_a_real_building_is_mapped_as_well_the_other_way_round(data):
    scans = list(open_recording(data / "carmen_radish_corrected" / "freiburg-101-corrected.log.gz"))
    there, back = judged(scans, "poor"), judged(backwards(scans), "poor")
    assert back.tracked == back.scans
    assert back.wrong == 0
    assert back.pairs[:, 0].mean() < 1.1 * there.pairs[:, 0].mean()


def test_every_beam_is_as_long_before_the_end_as_it_was_after_the_begin():
    rng = np.random.default_rng(0)
    scans = [
        Scan(np.full(9, 2.0), np.linspace(-3, 3, 9), stamp=stamp, beam_times=rng.uniform(0, 0.1, 9))
        for stamp in (1.0, 1.1, 1.3)
    ]
    turned = backwards(scans)
    for scan, same in zip(scans, turned[::-1], strict=True):
        np.testing.assert_allclose(
            same.stamp + same.beam_times, scans[-1].stamp - (scan.stamp + scan.beam_times)
        )
    assert [scan.stamp for scan in turned] == sorted(scan.stamp for scan in turned)
