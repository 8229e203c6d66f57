"""What is no line gives a typed error, never NaN."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from law_walls import assert_positive_definite, noises
from pydantic import ValidationError

from lidarcore import FITTERS, DegenerateLineError, ScanError, SensorNoise

NOISE = SensorNoise(0.02, 0.003)
every_fitter = pytest.mark.parametrize("name", FITTERS)
WITHOUT_CENTRE = ("utls", "wtls", "wctls", "ml")


@pytest.mark.parametrize("n", [0, 1])
def test_fewer_than_two_points_are_no_line(fit, n):
    with pytest.raises(DegenerateLineError, match="at least 2"):
        fit([1.0] * n, [0.1] * n, NOISE)


@pytest.mark.parametrize("n", [2, 3, 50])
@pytest.mark.parametrize("bearing", [0.0, 0.7, np.pi / 2, -3.0])
@pytest.mark.parametrize("distance", [0.05, 1.3, 1000.0])
def test_equal_points_are_no_line(fit, n, bearing, distance):
    with pytest.raises(DegenerateLineError):
        fit([distance] * n, [bearing] * n, NOISE)


THROUGH = {
    "one side": lambda b: ([1.0, 1.5, 2.0, 2.5, 4.0], [b] * 5),
    "both sides": lambda b: ([1.0, 2.0, 1.0, 2.0, 3.0], [b, b, b + np.pi, b + np.pi, b]),
    "opposite": lambda b: ([1.0, 1.0, 2.0, 2.0], [b, b + np.pi, b, b + np.pi]),
    "two points": lambda b: ([1.0, 2.0], [b, b]),
}


@pytest.mark.parametrize("points", THROUGH.values(), ids=THROUGH)
@pytest.mark.parametrize("name", WITHOUT_CENTRE)
@given(bearing=st.floats(-np.pi, np.pi))
def test_a_line_through_the_sensor_is_refused_where_it_cannot_be_expressed(name, points, bearing):
    with pytest.raises(DegenerateLineError):
        FITTERS[name].fit(*points(bearing), NOISE)


@pytest.mark.parametrize("points", THROUGH.values(), ids=THROUGH)
@pytest.mark.parametrize("name", [name for name in FITTERS if name not in WITHOUT_CENTRE])
@given(bearing=st.floats(-np.pi, np.pi))
def test_a_line_through_the_sensor_is_found_by_the_others(name, points, bearing):
    line = FITTERS[name].fit(*points(bearing), NOISE)
    assert line.r == pytest.approx(0, abs=1e-12)
    assert np.sin(line.alpha - bearing) ** 2 == pytest.approx(1, abs=1e-12)
    assert_positive_definite(line.covariance_published)
    assert_positive_definite(line.covariance_consistent)


@pytest.mark.parametrize("bad", [np.nan, -1.0, np.inf, -np.inf, 0.0])
@pytest.mark.parametrize("place", [0, 3, 9])
def test_a_bad_range_is_refused(fit, bad, place):
    ranges = np.full(10, 2.0)
    ranges[place] = bad
    with pytest.raises(ScanError, match=r"[Rr]ange"):
        fit(ranges, np.linspace(-0.3, 0.3, 10), NOISE)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_bad_bearing_is_refused(fit, bad):
    with pytest.raises(ScanError, match="bearing"):
        fit([1.0, 1.1, 1.2], [0.0, bad, 0.2], NOISE)


@pytest.mark.parametrize(
    ("ranges", "bearings"),
    [([1.0, 2.0], [0.1]), ([1.0], [0.1, 0.2]), ([[1.0, 2.0]], [[0.1, 0.2]])],
)
def test_shapes_that_do_not_match_are_refused(fit, ranges, bearings):
    with pytest.raises(ScanError, match="shape"):
        fit(ranges, bearings, NOISE)


@pytest.mark.parametrize("bad", [0.0, -0.01, np.nan, np.inf, 2.0])
@pytest.mark.parametrize("field", ["sigma_range", "sigma_bearing"])
def test_noise_must_be_positive_and_possible(field, bad):
    with pytest.raises(ValidationError, match=field):
        SensorNoise(**{field: bad})


@every_fitter
@given(
    beams=st.lists(
        st.tuples(st.floats(min_value=5e-324, allow_infinity=False, allow_nan=False), st.floats(-10, 10)),
        min_size=2,
        max_size=8,
    ),
    noise=noises,
)
def test_whatever_the_points_a_line_is_sound_or_refused(name, beams, noise):
    ranges, bearings = np.array(beams).T
    assert_sound_or_refused(name, ranges, bearings, noise)


@every_fitter
@given(
    beams=st.lists(st.tuples(st.floats(0.01, 50), st.floats(-np.pi, np.pi)), min_size=2, max_size=8),
    noise=noises,
)
def test_whatever_a_sensor_reports_a_line_is_sound_or_refused(name, beams, noise):
    ranges, bearings = np.array(beams).T
    assert_sound_or_refused(name, ranges, bearings, noise)


@every_fitter
@given(
    r=st.floats(-18, 0).map(lambda e: 10**e),
    alpha=st.floats(-np.pi, np.pi),
    along=st.lists(st.floats(-3, 3).filter(lambda t: abs(t) > 0.01), min_size=2, max_size=8),
    noise=noises,
)
def test_a_line_ever_closer_to_the_sensor_is_sound_or_refused(name, r, alpha, along, noise):
    points = r * np.exp(1j * alpha) + 1j * np.exp(1j * alpha) * np.array(along)
    line = assert_sound_or_refused(name, np.abs(points), np.angle(points), noise)
    if line is not None and np.ptp(along) > 0.1:
        # Whatever comes out is the line that was put in.
        assert abs(line.r - r) < 1e-6
        assert abs(np.sin(line.alpha - alpha)) < 1e-6


def assert_sound_or_refused(name, ranges, bearings, noise):
    try:
        line = FITTERS[name].fit(ranges, bearings, noise)
    except DegenerateLineError:
        return None
    assert -np.pi < line.alpha <= np.pi
    assert 0 <= line.r < np.inf
    assert_positive_definite(line.covariance_published)
    assert_positive_definite(line.covariance_consistent)
    return line


@pytest.mark.parametrize("name", FITTERS)
def test_points_around_the_sensor_make_no_wall_farther_away_than_all_of_them(name):
    rng = np.random.default_rng(0)
    bearings = np.linspace(-np.pi, np.pi, 200, endpoint=False)
    try:
        line = FITTERS[name].fit(1 + rng.normal(0, 0.01, 200), bearings, SensorNoise(0.01, 0.001))
    except DegenerateLineError:
        return
    assert line.r < 1.1
