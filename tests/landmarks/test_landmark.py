import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from landmark_maps import corner

from lidarcore.errors import LandmarkError
from lidarcore.landmarks import Box, Circle, Filter, Landmark


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"x": math.nan}, "finite"),
        ({"y": -math.inf}, "finite"),
        ({"last_seen": math.nan}, "finite"),
        ({"x": 2e7}, "metres"),
        ({"last_seen": 1e300}, "1e\\+300 s is not a time: give seconds"),
        ({"first_seen": -1.8e12}, "give seconds"),
        ({"var_x": math.nan}, "positive definite"),
        ({"cov_xy": math.nan}, "positive definite"),
        ({"var_x": 0.0}, "positive definite"),
        ({"var_y": -1e-4}, "positive definite"),
        ({"var_x": 1e-4, "var_y": 4e-4, "cov_xy": 2e-4}, "positive definite"),
        ({"var_x": math.inf}, "positive definite"),
        ({"var_x": 1e-300, "cov_xy": 0.0, "var_y": 1e-300}, "positive definite"),
        ({"first_seen": 2.0, "last_seen": 1.0}, "after last_seen"),
        ({"count": 0}, "at least once"),
        ({"count": 1.5}, "integer"),
        ({"count": True}, "integer"),
        ({"x": "1"}, "number"),
        ({"x": 1j}, "number"),
        ({"x": 10**400}, "number"),
        ({"id": 0}, "positive"),
        ({"id": 2**63}, "positive"),
        ({"kind": ""}, "kind"),
        ({"kind": "a\0b"}, "kind"),
        ({"method": None}, "method"),
    ],
)
def test_an_impossible_landmark_is_refused_with_the_reason(fields, text):
    with pytest.raises(LandmarkError, match=text):
        corner(**fields)


@pytest.mark.parametrize(
    ("xy", "covariance"),
    [
        ([1, 2, 3], np.eye(2)),
        ([1, 2], np.eye(3)),
        ([1, 2], [[1, 0.5], [0.2, 1]]),
        ([1, 2], np.full((2, 2), math.nan)),
        (["a", "b"], np.eye(2)),
    ],
)
def test_arrays_that_are_no_position_and_covariance_are_refused(xy, covariance):
    with pytest.raises(LandmarkError):
        Landmark.of(xy, covariance, "corner")


@given(
    st.floats(1e-3, 10), st.floats(1e-3, 10), st.floats(0, math.pi), st.sampled_from([np.float32, np.float64])
)
def test_sigma_is_the_longest_axis_of_the_ellipse(a, b, angle, dtype):
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([[c, -s], [s, c]])
    covariance = (rotation @ np.diag([a * a, b * b]) @ rotation.T).astype(dtype)
    landmark = Landmark.of(np.array([1, 2], dtype), covariance, "corner", count=np.int32(3))
    assert landmark.sigma == pytest.approx(max(a, b), rel=1e-5)
    np.testing.assert_allclose(landmark.covariance, covariance, rtol=1e-6, atol=1e-6 * covariance.max())
    assert {type(landmark.x), type(landmark.var_x)} == {float}
    assert type(landmark.count) is int


@pytest.mark.parametrize(
    "ask",
    [
        lambda: Box(1, 0, 0, 1),
        lambda: Box(0, 1, 1, 0),
        lambda: Box(0, math.nan, 1, 1),
        lambda: Circle(0, 0, -1),
        lambda: Circle(0, math.nan, 1),
        lambda: Circle(math.inf, 0, 1),
        lambda: Filter(seen_from=2, seen_to=1),
        lambda: Filter(seen_from=math.nan),
        lambda: Filter(max_sigma=-1),
        lambda: Filter(min_count=1.5),
        lambda: Filter(kinds="corner"),
    ],
)
def test_a_question_that_makes_no_sense_is_refused(ask):
    with pytest.raises(LandmarkError):
        ask()
