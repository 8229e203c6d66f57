from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from serving import room_ranges

from lidarcore import ExtractionSettings, Scan, compare
from lidarcore.tracking import GATE, MEMORY, Tracker, match


def found(xy: list[tuple[float, float]]) -> dict:
    """Features with corners at these places only, each between two segments of its own."""
    n = len(xy)
    corners = SimpleNamespace(xy=np.array(xy, float).reshape(-1, 2), segments=np.arange(2 * n).reshape(-1, 2))
    segments = SimpleNamespace(first_beam=np.arange(2 * n), last_beam=np.arange(2 * n))
    return {"ml": SimpleNamespace(corners=corners, segments=segments)}


def ids(tracker: Tracker, xy: list[tuple[float, float]]) -> list[int]:
    return [row.id for row in tracker.rows(found(xy))]


def test_a_corner_that_moves_a_little_keeps_its_id_and_one_that_jumps_does_not() -> None:
    tracker = Tracker()
    first = ids(tracker, [(0, 0), (2, 0)])
    assert ids(tracker, [(2.1, 0), (0.1, 0.1)]) == first[::-1]
    assert ids(tracker, [(0.1 + GATE + 0.01, 0.1), (2.1, 0)])[1] == first[0 + 1]
    assert len({*first, *ids(tracker, [(9, 9)])}) == 3


def test_the_closest_pair_is_matched_first() -> None:
    tracker = Tracker()
    a, b = ids(tracker, [(0, 0), (0.2, 0)])
    assert ids(tracker, [(0.15, 0), (-0.1, 0)]) == [b, a]


def test_a_corner_is_remembered_for_a_while() -> None:
    for missing, kept in ((MEMORY - 1, True), (MEMORY, False)):
        tracker = Tracker()
        first = ids(tracker, [(1, 1)])
        for _ in range(missing):
            ids(tracker, [])
        assert (ids(tracker, [(1, 1)]) == first) is kept


def test_after_forgetting_ids_are_new() -> None:
    tracker = Tracker()
    first = ids(tracker, [(1, 1)])
    tracker.forget()
    assert ids(tracker, [(1, 1)]) != first


@given(st.lists(st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), max_size=8), max_size=6))
def test_ids_are_unique_in_every_frame(frames: list[list[tuple[float, float]]]) -> None:
    tracker = Tracker()
    for xy in frames:
        given_ids = ids(tracker, xy)
        assert len(set(given_ids)) == len(xy)
        assert all(i > 0 for i in given_ids)


def test_corners_of_all_methods_are_matched_by_where_they_are() -> None:
    bearings = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    ranges = room_ranges(bearings) + np.random.default_rng(0).normal(0, 0.005, 720)
    features = compare(Scan(ranges, bearings), ExtractionSettings())
    rows = match(features)
    assert len(rows) == 4
    for row in rows:
        assert row.keys() == features.keys()
        xy = np.array([features[name].corners.xy[i] for name, i in row.items()])
        assert np.ptp(xy, axis=0).max() < 0.05


def test_a_piece_that_one_method_rejects_does_not_shift_the_others() -> None:
    """The second method has no segment 1: its indices are lower by one, its beams are not."""
    beams = np.arange(6)
    one = SimpleNamespace(
        segments=SimpleNamespace(first_beam=10 * beams, last_beam=10 * beams + 9),
        corners=SimpleNamespace(segments=np.array([[0, 1], [3, 4]])),
    )
    kept = np.array([0, 2, 3, 4, 5])
    two = SimpleNamespace(
        segments=SimpleNamespace(first_beam=10 * kept, last_beam=10 * kept + 9),
        corners=SimpleNamespace(segments=np.array([[2, 3]])),
    )
    assert match({"one": one, "two": two}) == [{"one": 0}, {"one": 1, "two": 0}]
