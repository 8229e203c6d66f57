"""Bad input is refused with a typed error that says what to do, and leaves the filter as it was."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from walks import POSTS, START_COVARIANCE, sighting

from lidarcore.errors import CovarianceError, LocalizationError, MotionError
from lidarcore.localization import LocalizationSettings, Localizer, Points, Slam

POSE = np.array([3.0, 1.5, 0.4])
MAP = Points(POSTS, 1e-6 * np.eye(2), "post")
RNG = np.random.default_rng(0)
SEEN = sighting(RNG, POSE, POSTS[:9])

FILTERS: list[Callable[[], Localizer | Slam]] = [
    lambda: Localizer(MAP, POSE, START_COVARIANCE),
    lambda: Slam(None, POSE, START_COVARIANCE),
]
BAD_STEPS: dict[str, tuple[dict[str, Any], type[Exception], str]] = {
    "the clock goes back": ({"stamp": 9.9}, MotionError, "clock went back by 0.1 s.*restart_clock"),
    "the stamp is NaN": ({"stamp": np.nan}, LocalizationError, "stamp is nan"),
    "odometry is missing": ({"odometry": None}, MotionError, "no odometry.*constant velocity"),
    "odometry is NaN": ({"odometry": [np.nan, 0, 0]}, LocalizationError, "all finite"),
    "odometry has two numbers": ({"odometry": [1.0, 2.0]}, LocalizationError, "x .m., y .m. and heading"),
    "the encoder was reset": ({"odometry": [-50.0, 0, 0]}, MotionError, "jumped by 51 m"),
    "an int16 of ticks wrapped": ({"odometry": [1 + 65536 * 3.5e-4, 0, 0]}, MotionError, "jumped by 22.9 m"),
    "the heading jumped": ({"odometry": [1.0, 0, 2.5]}, MotionError, "2.5 rad"),
}


@pytest.mark.parametrize("make", FILTERS)
@pytest.mark.parametrize("case", BAD_STEPS)
def test_a_bad_step_is_refused_and_changes_nothing(make: Callable[[], Localizer | Slam], case: str) -> None:
    change, error, message = BAD_STEPS[case]
    disturbed, undisturbed = make(), make()
    for tracker in (disturbed, undisturbed):
        tracker.step(SEEN, 10.0, [1.0, 0, 0])
    with pytest.raises(error, match=message):
        disturbed.step(SEEN, **({"stamp": 10.1, "odometry": [1.0, 0, 0]} | change))
    after, expected = (tracker.step(SEEN, 10.2, [1.05, 0, 0.01]) for tracker in (disturbed, undisturbed))
    np.testing.assert_array_equal(after.pose, expected.pose)
    np.testing.assert_array_equal(after.covariance, expected.covariance)


@pytest.mark.parametrize("make", FILTERS)
def test_after_restart_clock_the_filter_goes_on_from_the_new_odometry(
    make: Callable[[], Localizer | Slam],
) -> None:
    tracker = make()
    before = tracker.step(SEEN, 10.0, [1.0, 0, 0]).pose
    tracker.restart_clock()
    after = tracker.step(SEEN, 0.0, [-50.0, 0, 0]).pose
    np.testing.assert_allclose(after, before, atol=0.05)


@pytest.mark.parametrize(
    ("covariance", "message"),
    [
        (np.zeros((2, 2)), "not positive definite"),
        ([[1.0, 2.0], [2.0, 1.0]], "not positive definite"),
        ([[1.0, 0.5], [0.0, 1.0]], "not symmetric"),
        ([[np.nan, 0.0], [0.0, 1.0]], "not finite"),
    ],
)
def test_a_covariance_that_is_none_is_refused(covariance: Any, message: str) -> None:
    with pytest.raises(CovarianceError, match=message):
        Points([[1.0, 2.0]], covariance)
    full = np.eye(3)
    full[:2, :2] = covariance
    with pytest.raises(CovarianceError, match=message):
        Localizer(MAP, POSE, full)


def test_a_reset_to_a_bad_pose_changes_nothing() -> None:
    disturbed, undisturbed = FILTERS[0](), FILTERS[0]()
    assert isinstance(disturbed, Localizer)
    with pytest.raises(LocalizationError, match="all finite"):
        disturbed.reset([1, np.inf, 0], START_COVARIANCE)
    with pytest.raises(CovarianceError, match="not positive definite"):
        disturbed.reset(POSE + 1, np.zeros((3, 3)))
    with pytest.raises(LocalizationError, match=r"\(2, 2\)"):
        disturbed.reset(POSE + 1, np.eye(2))
    after, expected = (tracker.step(SEEN, 0.0, POSE).pose for tracker in (disturbed, undisturbed))
    np.testing.assert_array_equal(after, expected)


@pytest.mark.parametrize(
    ("xy", "kinds", "message"),
    [
        ([[np.nan, 1.0]], "post", "not finite"),
        ([1.0, 2.0], "post", "shape"),
        ([[1.0, 2.0, 3.0]], "post", "shape"),
        ([[1.0, 2.0]], ["post", "post"], "kinds"),
    ],
)
def test_points_that_make_no_sense_are_refused(xy: Any, kinds: Any, message: str) -> None:
    with pytest.raises(LocalizationError, match=message):
        Points(xy, np.eye(2), kinds)


def test_points_cannot_be_changed_behind_the_filter() -> None:
    with pytest.raises(ValueError, match="read-only"):
        MAP.xy[0, 0] = np.nan


@pytest.mark.parametrize(
    "wrong",
    [{"gate": 1.5}, {"gate": 0.999, "new_gate": 0.99}, {"ambiguity": 1000, "gate": 0.9, "new_gate": 0.91}],
)
def test_settings_that_contradict_each_other_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValidationError):
        LocalizationSettings(**wrong)
