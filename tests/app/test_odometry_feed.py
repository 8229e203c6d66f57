import numpy as np
import pytest

from app.odometry_feed import AHEAD, OdometryFeed, OdometryPose
from lidarcore.errors import MotionError
from lidarcore.localization import LocalizationSettings

LIMITS = LocalizationSettings()


def on_a_circle(stamp: float) -> OdometryPose:
    """A robot that drives a circle of a metre's radius at one radian a second."""
    return OdometryPose(stamp=stamp, x=np.sin(stamp), y=1 - np.cos(stamp), heading=stamp)


def true(stamp: float) -> list[float]:
    pose = on_a_circle(stamp)
    return [pose.x, pose.y, pose.heading]


@pytest.fixture
def feed() -> OdometryFeed:
    feed = OdometryFeed()
    for stamp in np.arange(0, 2.001, 0.05):
        feed.put(on_a_circle(float(stamp)), LIMITS)
    return feed


def test_between_two_poses_it_is_interpolated(feed: OdometryFeed) -> None:
    assert feed.at(1.02) == pytest.approx(true(1.02), abs=5e-4)


def test_a_little_later_the_motion_goes_on(feed: OdometryFeed) -> None:
    assert feed.at(2.04) == pytest.approx(true(2.04), abs=1e-3)


def test_long_before_and_after_nothing_is_known(feed: OdometryFeed) -> None:
    assert feed.at(-0.1) is None
    assert feed.at(2.0 + AHEAD + 0.01) is None
    assert OdometryFeed().at(0.0) is None


def test_after_a_jump_nothing_is_told_across_it(feed: OdometryFeed) -> None:
    reset = OdometryPose(stamp=2.05, x=50.0, y=0.0, heading=0.0)
    with pytest.raises(MotionError, match="jumped"):
        feed.put(reset, LIMITS)
    assert feed.at(2.02) is None
    for stamp in (2.1, 2.15):
        feed.put(OdometryPose(stamp=stamp, x=50.0, y=0.0, heading=0.0), LIMITS)
    assert feed.at(2.12) == pytest.approx([50, 0, 0])
