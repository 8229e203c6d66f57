"""A scan taken moment by moment: nothing is lost, and a wrong velocity in the deskewing does no harm."""

import numpy as np
import pytest
from living_room import EXTRACTION, living_room, room_corners

from lidarcore import Scan, extract
from lidarcore.geometry import wrap
from lidarcore.localization import LocalizationSettings, Localizer, Points, deskew
from lidarcore.localization.deskewing import skew
from lidarcore.localization.observations import corner_times, in_moments, nearest_moments
from lidarcore.scan import Array

MAP = Points(room_corners(), 1e-6 * np.eye(2))
SETTINGS = LocalizationSettings(motion="constant velocity")


@pytest.mark.parametrize("count", [0, 1, 9])
def test_every_point_is_in_one_moment(count: int) -> None:
    times = np.random.default_rng(0).uniform(0, 0.1, count)
    moments = nearest_moments(times, np.linspace(0, 0.1, 50))
    assert np.abs(moments - times).max(initial=0) <= 0.1 / 8 + 1e-12
    for parts in (in_moments(None, count), in_moments(moments, count)):
        assert sorted(np.concatenate([seen for _, seen in parts])) == list(range(count))


@pytest.mark.parametrize("turned", [0.0, 0.004, -0.004])
def test_a_corner_across_the_seam_of_the_revolution_was_seen_at_its_beginning_or_end(turned: float) -> None:
    bearings = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    towards = bearings + np.pi / 4 + turned
    ranges = 3 / np.maximum(np.abs(np.cos(towards)), np.abs(np.sin(towards)))
    scan = Scan(ranges, bearings, beam_times=bearings / 20)
    assert scan.beam_times is not None
    times = corner_times(found := extract(scan), scan.beam_times)
    at = np.arctan2(found.corners.xy[:, 1], found.corners.xy[:, 0])
    assert len(times) == 4
    assert np.abs(wrap(20 * times - at)).max() < 0.02


def test_skewing_undoes_deskewing() -> None:
    scan = next(living_room("moving", 1))
    velocity = 0.7, -0.9, 0.2
    deskewed = deskew(scan, *velocity)
    assert scan.beam_times is not None
    assert deskewed.beam_times is not None
    valid = deskewed.valid
    points = skew(Points(deskewed.xy[valid], np.eye(2)), deskewed.beam_times[valid], *velocity)
    order, other_order = np.argsort(deskewed.beam_times[valid]), np.argsort(scan.beam_times[scan.valid])
    np.testing.assert_allclose(points.xy[order], scan.xy[scan.valid][other_order], atol=1e-12)


def errors(deskewed_by: tuple[float, float, float], use_times: bool) -> Array:
    """Pose errors (3,) while scans are deskewed by a velocity that the sensor does not have."""
    localizer: Localizer | None = None
    found = []
    for scan in living_room("standing", 40, people=0):
        assert scan.truth is not None
        localizer = localizer or Localizer(MAP, scan.truth, np.eye(3) / 1e4, SETTINGS)
        taken = deskew(scan, *deskewed_by)
        features = extract(taken, EXTRACTION)
        points, times = Points.from_corners(features.corners), None
        if use_times:
            assert taken.beam_times is not None
            times = nearest_moments(corner_times(features, taken.beam_times), taken.beam_times)
            points = skew(points, times, *deskewed_by)
        error = localizer.step(points, scan.stamp, None, times).pose - scan.truth
        found.append([error[0], error[1], wrap(error[2])])
    return np.array(found[10:])


def test_a_wrong_velocity_in_the_deskewing_is_made_good() -> None:
    wrong = 0.1, 0.02, -0.05
    right = np.abs(errors((0.0, 0.0, 0.0), True)).mean(axis=0)
    made_good = np.abs(errors(wrong, True)).mean(axis=0)
    all_at_once = np.abs(errors(wrong, False)).mean(axis=0)
    assert (made_good < 2.5 * right).all(), (right, made_good)
    assert (made_good[:2] < 0.7 * all_at_once[:2]).all(), (made_good, all_at_once)
