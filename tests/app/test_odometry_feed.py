import numpy as np
import pytest
from lidarcore_app.sources.odometry_feed import AHEAD, OdometryFeed, OdometryStatus

from lidarcore.errors import MotionError
from lidarcore.localization import LocalizationSettings

LIMITS = LocalizationSettings()


Sent = tuple[float, list[float]]  # stamp and pose


def true(stamp: float) -> list[float]:
    """A robot that drives a circle of a metre's radius at one radian a second."""
    return [np.sin(stamp), 1 - np.cos(stamp), stamp]


def on_a_circle(stamp: float) -> Sent:
    return stamp, true(stamp)


@pytest.fixture
def feed() -> OdometryFeed:
    feed = OdometryFeed()
    for stamp in np.arange(0, 2.001, 0.05):
        feed.put(*on_a_circle(float(stamp)), LIMITS)
    return feed


def test_between_two_poses_it_is_interpolated(feed: OdometryFeed) -> None:
    assert feed.at(1.02) == pytest.approx(true(1.02), abs=5e-4)


def test_a_little_later_the_motion_goes_on(feed: OdometryFeed) -> None:
    assert feed.at(2.04) == pytest.approx(true(2.04), abs=1e-3)


def test_long_before_and_after_nothing_is_known(feed: OdometryFeed) -> None:
    assert feed.at(-0.1) is None
    assert feed.at(2.0 + AHEAD + 0.01) is None
    assert OdometryFeed().at(0.0) is None


def far_away(stamp: float) -> Sent:
    return stamp, [50.0, 0.0, 0.0]


def test_two_poses_that_agree_after_a_jump_are_gone_on_from_and_nothing_is_told_across_it(
    feed: OdometryFeed,
) -> None:
    with pytest.raises(MotionError, match=r"jumped by 49.* left out"):
        feed.put(*far_away(2.05), LIMITS)
    assert feed.at(2.02) == pytest.approx(true(2.02), abs=1e-3)
    for stamp in (2.1, 2.15):
        feed.put(*far_away(stamp), LIMITS)
    assert feed.at(2.02) is None
    for stamp in (2.06, 2.12):
        assert feed.at(stamp) == pytest.approx([50, 0, 0])


@pytest.mark.parametrize("wrong", [far_away(2.01), on_a_circle(1.5)], ids=["jumped", "clock went back"])
def test_a_single_wrong_pose_takes_nothing_from_what_others_send(feed: OdometryFeed, wrong: Sent) -> None:
    for stamp in np.linspace(2.05, 3, 20):
        with pytest.raises(MotionError):
            feed.put(*wrong, LIMITS)
        feed.put(*on_a_circle(float(stamp)), LIMITS)
    for stamp in (1.02, 2.02, 2.9):
        assert feed.at(stamp) == pytest.approx(true(stamp), abs=1e-3)
    assert (feed.status().taken, feed.status().refused) == (61, 20)


def test_after_the_clock_was_set_back_it_goes_on_with_the_second_pose(feed: OdometryFeed) -> None:
    with pytest.raises(MotionError, match="went back by 3 s"):
        feed.put(*on_a_circle(-1.0), LIMITS)
    feed.put(*on_a_circle(-0.95), LIMITS)
    assert feed.at(-0.98) == pytest.approx(true(-0.98), abs=1e-3)
    assert feed.status().stamp == -0.95


def test_stamps_that_jitter_are_no_jump(feed: OdometryFeed) -> None:
    """At 1 m/s 20 ms are 2 cm, stamped within 0.1 ms: 200 m/s if taken literally."""
    feed.put(2.0001, true(2.02), LIMITS)
    with pytest.raises(MotionError, match="jumped"):
        feed.put(2.0002, true(4.0), LIMITS)


def test_the_state_says_whether_a_scan_was_given_a_pose_and_else_why(feed: OdometryFeed) -> None:
    assert OdometryFeed().status("anything") == OdometryStatus(0, 0, None, used=False, problem=None)
    assert feed.status().problem == "No scan has been processed since."
    feed.at(1.0)
    assert feed.status() == OdometryStatus(41, 0, 2.0, used=True, problem=None)
    feed.at(-3.0)
    assert not feed.status().used
    assert "5.0 s ahead of the scans" in feed.status().problem
    feed.at(7.0)
    assert "5.0 s behind the scans" in feed.status().problem
    assert feed.status("Nothing is localized.").problem == "Nothing is localized."
    feed.clear()
    assert feed.status().taken == 0
    feed.put(*on_a_circle(0.0), LIMITS)
    feed.at(0.1)
    assert "too little" in feed.status().problem
