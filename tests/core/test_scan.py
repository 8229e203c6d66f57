"""A scan takes what sensors deliver, puts it in the order of the ring, and refuses what is none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarcore import FITTERS, ExtractionSettings, Scan, ScanError, SensorNoise, compare, extract

angles = st.lists(st.integers(-3141, 3141).map(lambda k: k / 1000), min_size=1, max_size=50, unique=True)


def beams_of(scan):
    return {
        (b, r, q, t)
        for b, r, q, t in zip(scan.bearings, scan.ranges, scan.quality, scan.beam_times, strict=True)
    }


@given(bearings=angles, seed=st.integers(0, 2**32 - 1))
def test_beams_in_any_order_keep_their_columns_and_follow_the_ring(bearings, seed):
    rng = np.random.default_rng(seed)
    n = len(bearings)
    columns = (
        rng.permutation(n) + 1.0,
        np.array(bearings),
        rng.permutation(n) + 0.5,
        rng.permutation(n) + 0.25,
    )
    scan = Scan(columns[0], columns[1], quality=columns[2], beam_times=columns[3])
    assert beams_of(scan) == set(zip(columns[1], columns[0], columns[2], columns[3], strict=True))
    steps = np.diff(np.append(scan.bearings, scan.bearings[0])) % (2 * np.pi)
    assert steps.sum() == pytest.approx(2 * np.pi if n > 1 else 0, abs=1e-6)


def test_clockwise_beams_are_turned_around():
    clockwise = np.radians(np.arange(350, 0, -10.0))
    scan = Scan(np.arange(1.0, 36), clockwise)
    assert (np.diff(scan.bearings) > 0).all()
    assert scan.ranges[0] == 35


@pytest.mark.parametrize("start", [-np.pi, 0.0, 2.0, -1.0])
def test_a_ring_is_kept_as_it_is_wherever_it_starts_and_wraps(start):
    bearings = np.angle(np.exp(1j * (start + np.radians(np.arange(0, 360, 3.0)))))
    ranges = np.arange(1.0, 121)
    scan = Scan(ranges, bearings)
    assert (scan.bearings == bearings).all()
    assert (scan.ranges == ranges).all()


def test_more_than_a_turn_is_sorted_into_one_ring():
    bearings = np.radians(np.arange(0, 720, 7.0))
    scan = Scan(np.ones(len(bearings)), bearings)
    assert (np.diff(scan.bearings % (2 * np.pi)) > 0).all()


@given(bearings=angles, seed=st.integers(0, 2**32 - 1))
def test_other_ranges_and_bearings_of_a_scan_make_the_scan_that_has_them(bearings, seed):
    """In any order: every other field stays, and goes along where it has a value for each beam."""
    rng = np.random.default_rng(seed)
    n = len(bearings)
    rest = {"quality": rng.random(n), "beam_times": rng.random(n), "stamp": 3.0, "odometry": [1, 2, 3],
            "truth": [4, 5, 6], "gaps": [[0.1, 0.2]]}  # fmt: skip
    before = Scan(np.full(n, np.nan), np.linspace(-1, 1, n), **rest)
    ranges = np.where(rng.random(n) < 0.3, np.nan, rng.random(n) + 1)
    assert not before.valid.any()
    scan, expected = before.with_beams(ranges, np.array(bearings)), Scan(ranges, bearings, **rest)
    for name in Scan.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(scan, name), getattr(expected, name), name)
    assert (scan.valid == expected.valid).all()
    assert not any(getattr(scan, name).flags.writeable for name in ("ranges", "bearings", "quality"))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_other_bearings_that_are_no_numbers_are_refused(bad):
    scan = Scan([1.0, 2.0], [0.0, 0.1])
    with pytest.raises(ScanError, match="not a finite number"):
        scan.with_beams(np.ones(2), np.array([0.0, bad]))


@pytest.mark.parametrize("marker", [0.0, -1.0, np.inf, -np.inf, np.nan])
def test_every_marker_of_a_missing_return_becomes_nan(marker):
    scan = Scan([1.0, marker, 2.0], [0.0, 0.1, 0.2])
    assert np.isnan(scan.ranges[1])
    assert scan.valid.tolist() == [True, False, True]
    assert np.isnan(scan.xy[1]).all()
    assert scan.xy[2] == pytest.approx([2 * np.cos(0.2), 2 * np.sin(0.2)])


def test_a_scan_keeps_private_arrays_that_nobody_can_change():
    ranges, bearings, quality = np.ones(3), np.array([0.1, 0.2, 0.3]), np.ones(3)
    scan = Scan(ranges, bearings, quality=quality, odometry=[1, 2, 3])
    ranges[0] = bearings[0] = quality[0] = 7
    assert (scan.ranges == 1).all()
    assert scan.bearings[0] == 0.1
    for array in (scan.ranges, scan.bearings, scan.quality, scan.odometry):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 5
    with pytest.raises(AttributeError):
        scan.ranges = ranges


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_bearing_that_is_no_number_is_refused(bad):
    with pytest.raises(ScanError, match="bearing"):
        Scan([1.0, 1.0], [0.0, bad])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (dict(ranges=[], bearings=[]), "empty"),
        (dict(ranges=[1, 2], bearings=[0]), "bearings has 1"),
        (dict(ranges=[1], bearings=[0, 1]), "bearings has 2"),
        (dict(ranges=[[1, 2]], bearings=[[0, 1]]), "shape"),
        (dict(ranges=1.0, bearings=0.0), "shape"),
        (dict(ranges=[1, 2], bearings=[0, 1], quality=[3]), "quality has 1"),
        (dict(ranges=[1, 2], bearings=[0, 1], beam_times=[0, 1, 2]), "beam_times has 3"),
        (dict(ranges=[1], bearings=[0], stamp=np.nan), "stamp"),
        (dict(ranges=[1], bearings=[0], odometry=[0, 0]), "odometry"),
        (dict(ranges=[1], bearings=[0], odometry=[0, 0, np.nan]), "odometry"),
    ],
)
def test_what_is_no_scan_is_refused_with_the_name_of_what_is_wrong(arguments, message):
    with pytest.raises(ScanError, match=message):
        Scan(**arguments)


@pytest.mark.parametrize("turns", [0, 1, -1, 1000, 10**6, 10**9, 10**12])
def test_bearings_many_turns_away_are_right_or_refused(turns):
    """Angles may be accumulated over a day; what cosine and sine cannot resolve must not pass silently."""
    incidence = np.linspace(-0.5, 0.5, 60)
    bearings = incidence + 2 * np.pi * turns
    try:
        features = extract(Scan(2 / np.cos(bearings), bearings))
    except ScanError:
        return
    assert len(features.segments) == 1
    assert features.segments.lines.alpha[0] == pytest.approx(0, abs=1e-9 + 1e-14 * abs(turns))
    assert features.segments.lines.r[0] == pytest.approx(2, abs=1e-9 + 1e-14 * abs(turns))


@pytest.mark.parametrize(
    "degrees", [np.arange(-45.0, 46.0), np.arange(0.0, 360.0)], ids=["90 degrees", "a turn"]
)
def test_degrees_are_not_taken_for_radians(degrees):
    with pytest.raises(ScanError, match="not degrees"):
        Scan(np.full(len(degrees), 2.0), degrees)
    with pytest.raises(ScanError, match="radians"):
        FITTERS["ml"].fit(np.full(len(degrees), 2.0), degrees, SensorNoise())


def test_a_misspelt_or_unknown_name_is_refused():
    with pytest.raises(ValueError, match="min_pionts"):
        ExtractionSettings(min_pionts=3)
    with pytest.raises(ValueError, match="unknown fitters"):
        compare(Scan([1.0, 1.0], [0.0, 0.1]), fitters=["zz"])
