from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from serving import room_ranges

from lidarcore import ExtractionSettings, Scan, compare
from lidarcore.tracking import GATE, MEMORY, Tracker, match

SIGMA = 0.005  # m, of x and y of the corners that are found


def found(xy: list[tuple[float, float]], noise_excess: float = 1.0) -> dict:
    """Features with corners at these places only, each between two segments of its own."""
    n = len(xy)
    corners = SimpleNamespace(
        xy=np.array(xy, float).reshape(-1, 2),
        segments=np.arange(2 * n).reshape(-1, 2),
        covariance_consistent=np.tile(SIGMA**2 * np.eye(2), (n, 1, 1)),
    )
    segments = SimpleNamespace(first_beam=np.arange(2 * n), last_beam=np.arange(2 * n))
    seen = SimpleNamespace(corners=corners, segments=segments, noise_excess=noise_excess)
    return {"ml": seen}


def ids(tracker: Tracker, xy: list[tuple[float, float]]) -> list[int]:
    return [row.id for row in tracker.rows(found(xy))]


def test_a_corner_that_moves_a_little_keeps_its_id_and_one_that_jumps_does_not() -> None:
    tracker = Tracker()
    first = ids(tracker, [(0, 0), (2, 0)])
    assert ids(tracker, [(2.1, 0), (0.1, 0.1)]) == first[::-1]
    jumped, stayed = ids(tracker, [(0.1 + GATE + 0.01, 0.1), (2.1, 0)])
    assert stayed == first[1]
    assert jumped not in first
    a_metre_on, _ = ids(tracker, [(1.5, 0.1), (2.1, 0)])
    assert a_metre_on not in (*first, jumped)


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


ROOM = [(3.0, 2.0), (-3.0, 2.0), (-3.0, -2.0), (3.0, -2.0)]
TWO_SECONDS = 20  # frames


def patient() -> Tracker:
    return Tracker(dormant=30 * MEMORY)


def test_a_corner_that_was_hidden_comes_back_as_itself() -> None:
    for hidden, kept in ((TWO_SECONDS, True), (30 * MEMORY - 1, True), (30 * MEMORY, False)):
        tracker = patient()
        first = ids(tracker, ROOM)
        for _ in range(hidden):
            assert ids(tracker, ROOM[1:]) == first[1:]
        assert ids(tracker, ROOM)[1:] == first[1:]
        assert (ids(tracker, ROOM)[0] == first[0]) is kept


def test_another_corner_near_a_hidden_one_gets_an_id_of_its_own() -> None:
    """Someone's leg before the corner makes corners as well: they take nothing from the one behind."""
    tracker = patient()
    first = ids(tracker, ROOM)
    beside = (ROOM[0][0] - 0.1, ROOM[0][1])
    ids(tracker, [beside, *ROOM[1:]])
    assert ids(tracker, [beside, *ROOM])[1:] == first
    for _ in range(TWO_SECONDS):
        ids(tracker, ROOM[1:])
    assert ids(tracker, [beside, *ROOM[1:]])[0] not in first


def test_a_sensor_that_moves_finds_no_hidden_corner_again_at_its_old_place() -> None:
    """By 10 cm in steps of 1 cm: what is seen keeps its id, and what now lies where a hidden one was is another."""
    tracker = patient()
    first = ids(tracker, ROOM)
    for _ in range(TWO_SECONDS):
        ids(tracker, ROOM[1:])
    for step in range(1, 11):
        moved = [(x - 0.01 * step, y) for x, y in ROOM[1:]]
        assert ids(tracker, moved) == first[1:]
    assert ids(tracker, [ROOM[0], *moved])[0] not in first


def test_where_the_noise_is_told_too_small_places_are_told_apart_less_finely() -> None:
    """Seen four times the noise told: 8 sigma of what is told are 2 of what is."""
    off = (ROOM[0][0] + 8 * np.sqrt(2) * SIGMA, ROOM[0][1])
    for excess, kept in ((1.0, False), (4.0, True)):
        tracker = patient()
        (first, *_) = (row.id for row in tracker.rows(found(ROOM, excess)))
        for _ in range(TWO_SECONDS):
            tracker.rows(found(ROOM[1:], excess))
        assert (tracker.rows(found([off, *ROOM[1:]], excess))[0].id == first) is kept


def test_noise_does_not_cost_a_standing_sensor_its_ids() -> None:
    """Squared distances between two sightings are chi-square with 2: 1e-4 of 2000 corners lose their id, and 7 or more
    with 3e-9. Covariances that were not added up would lose 20."""
    rng, lost = np.random.default_rng(5), 0
    for _ in range(500):
        tracker = Tracker(memory=0, dormant=TWO_SECONDS)
        first, _, again = (
            ids(tracker, xy.tolist())
            for xy in (
                ROOM + rng.normal(0, SIGMA, (4, 2)),
                np.empty((0, 2)),
                ROOM + rng.normal(0, SIGMA, (4, 2)),
            )
        )
        lost += sum(a != b for a, b in zip(first, again, strict=True))
    assert lost <= 6


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
