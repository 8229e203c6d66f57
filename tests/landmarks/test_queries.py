"""Answers of a map of 100,000 landmarks against numpy over all of them."""

import math

import numpy as np
import pytest
from landmark_maps import RandomLandmarks, corner

from lidarcore.errors import LandmarkError, UnknownLandmarkError
from lidarcore.landmarks import Atlas, Box, Circle, Filter

FILTERS = {
    "all": (Filter(), lambda t: np.full(len(t.ids), True)),
    "kind": (Filter(kinds=("cluster",)), lambda t: t.kind == "cluster"),
    "kinds": (Filter(kinds=("cluster", "pole")), lambda t: t.kind == "cluster"),
    "method": (Filter(methods=("ml",)), lambda t: t.method == "ml"),
    "time": (
        Filter(seen_from=4e4, seen_to=5e4),
        lambda t: (t.last_seen >= 4e4) & (t.first_seen <= 5e4),
    ),
    "count": (Filter(min_count=60), lambda t: t.count >= 60),
    "sigma": (Filter(max_sigma=0.1), lambda t: t.sigma <= 0.1),
    "rare": (
        Filter(kinds=("cluster",), min_count=99, max_sigma=0.05),
        lambda t: (t.kind == "cluster") & (t.count >= 99) & (t.sigma <= 0.05),
    ),
    "none": (Filter(kinds=("pole",)), lambda t: np.full(len(t.ids), False)),
}
POINTS = [(30, 40), (33.3, 38.7), (200, 200), (-50, 250), (600, -100)]


@pytest.fixture(scope="module")
def truth():
    return RandomLandmarks(20_000)


@pytest.fixture(scope="module")
def big_map(truth, tmp_path_factory):
    """In the same place as another session's."""
    with Atlas(tmp_path_factory.mktemp("maps") / "big.db") as atlas:
        landmark_map = atlas.begin("big", 0.0)
        assert landmark_map.put(truth.landmarks()) == truth.ids.tolist()
        atlas.begin("other", 0.0).put(RandomLandmarks(4_000, seed=1).landmarks())
        yield landmark_map


@pytest.fixture(params=FILTERS)
def filtered(request, truth):
    """A filter, and which landmarks pass it."""
    which, passes = FILTERS[request.param]
    return which, passes(truth)


def ids(landmarks):
    return [landmark.id for landmark in landmarks]


@pytest.mark.parametrize(
    "bounds", [(29, 39, 30, 41), (-60, -60, 0, 0), (25, 30, 60, 60), (300, 300, 301, 301)]
)
def test_a_box_holds_what_is_in_it(big_map, truth, filtered, bounds):
    which, passes = filtered
    low, high = np.array(bounds).reshape(2, 2)
    inside = truth.ids[((truth.xy >= low) & (truth.xy <= high)).all(1) & passes]
    page = big_map.find(Box(*bounds), which, limit=10_000)
    assert ids(page.landmarks) == inside[:10_000].tolist()
    assert (page.next is None) == (len(inside) <= 10_000)


@pytest.mark.parametrize("circle", [(30, 40, 0.5), (33, 41, 6.0), (100, 100, 30.0)])
def test_a_circle_holds_what_is_in_it(big_map, truth, filtered, circle):
    which, passes = filtered
    inside = truth.ids[(np.hypot(*(truth.xy - circle[:2]).T) <= circle[2]) & passes]
    assert ids(big_map.find(Circle(*circle), which, limit=10_000).landmarks) == inside[:10_000].tolist()


def test_edges_belong_to_a_region_to_the_last_bit(big_map, truth):
    for x, y in truth.xy[100:300]:
        assert len(big_map.find(Box(x, y, x, y)).landmarks) == 1
        assert not big_map.find(Box(np.nextafter(x, math.inf), y, x + 1e-7, y)).landmarks


@pytest.mark.parametrize("region", [Box(20, 30, 45, 60), Box(100, 100, 140, 130), Circle(30, 40, 5), None])
def test_pages_are_the_whole_without_overlap(big_map, region):
    which, after, pages = Filter(min_count=50), 0, []
    while after is not None:
        page = big_map.find(region, which, after, limit=997)
        pages += ids(page.landmarks)
        after = page.next
    assert pages == ids(m for m in everything(big_map, region) if m.count >= 50)


def everything(landmark_map, region):
    """Landmarks in a region by looking at each."""
    if isinstance(region, Circle):
        return [m for m in landmark_map if math.hypot(m.x - region.x, m.y - region.y) <= region.radius]
    if isinstance(region, Box):
        return [
            m for m in landmark_map
            if region.x_min <= m.x <= region.x_max and region.y_min <= m.y <= region.y_max
        ]  # fmt: skip
    return list(landmark_map)


@pytest.mark.parametrize("point", POINTS)
def test_the_nearest_are_those_of_all_distances_sorted(big_map, truth, filtered, point):
    which, passes = filtered
    distance = np.where(passes, np.hypot(*(truth.xy - point).T), math.inf)
    for k, within in ((1, math.inf), (30, math.inf), (30, 2.0)):
        check_nearest(big_map.nearest(point, k, which, within), distance, k, within)


@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize("noise", [np.zeros((2, 2)), [[0.02, 0.01], [0.01, 0.03]], [[4.0, 0.0], [0.0, 1e-4]]])
def test_the_nearest_by_mahalanobis_distance_too(big_map, truth, point, noise):
    distance = mahalanobis(truth, point, noise)
    covariance = noise if np.any(noise) else None
    for k, within in ((1, math.inf), (30, math.inf), (30, 3.0)):
        found = big_map.nearest(point, k, within=within, metric="mahalanobis", covariance=covariance)
        check_nearest(found, distance, k, within)


def test_the_nearest_by_mahalanobis_distance_pass_the_filter(big_map, truth, filtered):
    which, passes = filtered
    distance = np.where(passes, mahalanobis(truth, POINTS[1], 0.01 * np.eye(2)), math.inf)
    found = big_map.nearest(POINTS[1], 30, which, metric="mahalanobis", covariance=0.01 * np.eye(2))
    check_nearest(found, distance, 30, math.inf)


def mahalanobis(truth, point, noise):
    d = truth.xy - point
    return np.sqrt(np.einsum("ni,nij,nj->n", d, np.linalg.inv(truth.covariance + np.asarray(noise)), d))


def check_nearest(found, distance, k, within):
    expected = np.sort(distance[np.isfinite(distance) & (distance <= within)])[:k]
    np.testing.assert_allclose([n.distance for n in found], expected, rtol=1e-9)
    np.testing.assert_allclose([distance[n.landmark.id - 1] for n in found], expected, rtol=1e-9)
    assert len({n.landmark.id for n in found}) == len(found)


def test_landmarks_on_one_spot_come_in_the_order_of_their_ids(big_map, truth):
    assert [n.landmark.id for n in big_map.nearest(truth.xy[0], 20)] == list(range(1, 21))


@pytest.mark.parametrize("metric", ["euclidean", "mahalanobis"])
def test_an_empty_map_has_nothing_anywhere(landmark_map, metric):
    assert landmark_map.nearest((0, 0), 3, metric=metric) == []
    assert landmark_map.find(Box(-1, -1, 1, 1)).landmarks == []
    (id,) = landmark_map.put([corner()])
    landmark_map.clear()
    assert landmark_map.nearest((0, 0), 3, metric=metric) == []
    assert landmark_map.extent() is None
    with pytest.raises(UnknownLandmarkError):
        landmark_map.history(id)


@pytest.mark.parametrize("metric", ["euclidean", "mahalanobis"])
@pytest.mark.parametrize("others", [0, 1500])
def test_a_landmark_is_found_where_it_moved_and_as_certain_as_it_became(landmark_map, metric, others):
    (moving, _) = landmark_map.put([corner(0, 0, var_x=100, var_y=100), corner(5, 0)])
    landmark_map.put(corner(400 + i % 30, 400 + i // 30) for i in range(others))
    landmark_map.put([corner(900, 900, var_x=1e-8, cov_xy=0.0, var_y=1e-8, id=moving)])
    assert landmark_map.nearest((1, 0), 1, metric=metric)[0].landmark.x == 5
    assert landmark_map.nearest((899, 899), 1, metric=metric)[0].landmark.id == moving
    assert len(landmark_map.nearest((0, 0), 2000, metric=metric)) == others + 2
    assert not landmark_map.find(Circle(0, 0, 1)).landmarks


@pytest.mark.parametrize("metric", ["euclidean", "mahalanobis"])
@pytest.mark.parametrize("n", [10, 1500])
def test_sessions_in_one_place_do_not_see_each_other(atlas, metric, n):
    truths = [RandomLandmarks(n, seed) for seed in range(5)]
    maps = [atlas.begin(f"run {seed}", 0.0) for seed in range(5)]
    first, *_, last = [m.put(t.landmarks()) for m, t in zip(maps, truths, strict=True)]
    assert set(first).isdisjoint(last)
    for landmark_map, truth in zip(maps, truths, strict=True):
        found = landmark_map.nearest((30, 40), 10, metric=metric)
        distance = mahalanobis(truth, (30, 40), np.zeros((2, 2)))
        if metric == "euclidean":
            distance = np.hypot(*(truth.xy - (30, 40)).T)
        np.testing.assert_allclose([one.distance for one in found], np.sort(distance)[:10], rtol=1e-9)
        inside = (np.abs(truth.xy - (30, 40)) <= 5).all(1)
        page = landmark_map.find(Box(25, 35, 35, 45))
        assert [(m.x, m.y) for m in page.landmarks] == [tuple(xy) for xy in truth.xy[inside]]
        assert len(landmark_map) == n


@pytest.mark.parametrize(
    "asked",
    [
        {"xy": (0, math.nan)},
        {"xy": (0, math.inf)},
        {"xy": (0, 0, 0)},
        {"k": 0},
        {"k": 10_001},
        {"k": 2.5},
        {"within": -1},
        {"within": math.nan},
        {"metric": "manhattan"},
        {"covariance": np.eye(2)},
        {"metric": "mahalanobis", "covariance": [[1, 1], [1, 1]]},
        {"metric": "mahalanobis", "covariance": [[1, math.nan], [math.nan, 1]]},
    ],
)
def test_a_question_for_the_nearest_that_makes_no_sense_is_refused(big_map, asked):
    with pytest.raises(LandmarkError):
        big_map.nearest(**({"xy": (0, 0)} | asked))


@pytest.mark.parametrize("asked", [{"limit": 0}, {"limit": 10_001}, {"after": math.nan}, {"after": "1"}])
def test_a_page_that_makes_no_sense_is_refused(big_map, asked):
    with pytest.raises(LandmarkError):
        big_map.find(**asked)
