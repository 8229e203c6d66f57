import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarcore import Scan, extract
from lidarcore.errors import LocalizationError, ScanError
from lidarcore.localization.deskewing import deskew
from lidarcore.localization.ekf.motion_kernels import arc
from lidarcore.simulation.rooms import rectangular_room

TIMES = np.linspace(0, 0.1, 600)
BEARINGS = np.linspace(-3.1, 3.1, 600)
ROOM = rectangular_room(6, 4)


def moving_scan(v: float, w: float) -> Scan:
    """A noiseless scan of the room from the origin on, along the arc of v and w."""
    poses = np.array([arc(v, w, time)[0] for time in TIMES])
    ranges, _ = ROOM.cast(poses, BEARINGS)
    return Scan(ranges, BEARINGS, beam_times=TIMES)


@given(st.floats(-2, 2), st.floats(-3, 3))
def test_every_point_of_a_deskewed_scan_lies_on_a_wall(v: float, w: float) -> None:
    x, y = np.abs(deskew(moving_scan(v, w), v, w).xy).T
    assert np.minimum(np.abs(x - 3), np.abs(y - 2)).max() < 1e-9


def test_deskewing_brings_the_corners_back_to_where_they_are() -> None:
    v, w = 1.5, 2.0
    scan = moving_scan(v, w)
    errors = [np.abs(np.abs(extract(seen).corners.xy) - [3, 2]).max() for seen in (scan, deskew(scan, v, w))]
    assert errors[0] > 0.1
    assert errors[1] < 1e-3


def test_speeds_that_grow_within_the_revolution_are_taken_out_with_their_acceleration() -> None:
    """The sensor is integrated in small steps: 1 m/s and 0.5 rad/s in the middle, growing by 2 m/s² and 3 rad/s²."""
    fine = np.linspace(0, 0.1, 100_001)
    middle = TIMES.mean()
    heading = np.interp(TIMES, fine, _integrated(0.5 + 3 * (fine - middle), fine))
    speed, turned = 1 + 2 * (fine - middle), _integrated(0.5 + 3 * (fine - middle), fine)
    x, y = (np.interp(TIMES, fine, _integrated(speed * along(turned), fine)) for along in (np.cos, np.sin))
    ranges, _ = ROOM.cast(np.stack([x, y, heading], -1), BEARINGS)
    scan = Scan(ranges, BEARINGS, beam_times=TIMES)
    errors = []
    for seen in (deskew(scan, 1, 0.5), deskew(scan, 1, 0.5, acceleration=(2, 3, 0))):
        a, b = np.abs(seen.xy).T
        errors.append(np.minimum(np.abs(a - 3), np.abs(b - 2)).max())
    assert errors[0] > 5e-3
    assert errors[1] < 5e-4


def _integrated(values: np.ndarray, times: np.ndarray) -> np.ndarray:
    return np.concatenate([[0], np.cumsum((values[1:] + values[:-1]) / 2 * np.diff(times))])


def test_a_missing_return_stays_missing() -> None:
    ranges = np.full(600, 2.0)
    ranges[100:110] = np.nan
    straightened = deskew(Scan(ranges, BEARINGS, beam_times=TIMES), 1.0, 1.0)
    assert (~straightened.valid).sum() == 10


def test_returns_carried_farther_than_numbers_go_are_lost() -> None:
    found = deskew(moving_scan(0, 0), 1e200, 0)
    assert found.valid.tolist() == [True] + 599 * [False]
    assert np.isfinite(found.bearings).all()


def test_a_sensor_that_turned_farther_than_numbers_go_is_refused() -> None:
    scan = Scan(np.ones(2), np.array([0.0, 0.1]), beam_times=np.array([0.0, 10.0]))
    with pytest.raises(ScanError, match="not a finite number"):
        deskew(scan, 0, 1e308)


def test_without_beam_times_it_says_so() -> None:
    with pytest.raises(LocalizationError, match="no beam times"):
        deskew(Scan(np.ones(5), BEARINGS[:5]), 1, 0)
    with pytest.raises(LocalizationError, match="finite"):
        deskew(moving_scan(0, 0), np.nan, 0)
    with pytest.raises(LocalizationError, match="finite"):
        deskew(moving_scan(0, 0), 0, 0, acceleration=(np.nan, 0, 0))
