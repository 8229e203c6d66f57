import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lidarcore.poses import wrap


@given(st.floats(-1e4, 1e4))
def test_a_wrapped_angle_is_the_same_direction_within_half_a_turn(angle: float) -> None:
    wrapped = float(wrap(angle))
    assert -np.pi < wrapped <= np.pi
    np.testing.assert_allclose(np.exp(1j * wrapped), np.exp(1j * angle), atol=1e-11)


def test_the_seam_belongs_to_the_positive_side() -> None:
    np.testing.assert_array_equal(wrap([np.pi, -np.pi, 3 * np.pi]), [np.pi] * 3)


def test_nan_is_not_hidden() -> None:
    assert np.isnan(wrap([np.nan, 1.0])).tolist() == [True, False]
