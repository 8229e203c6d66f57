"""Walls asked for by place, direction and nearness, against samples along them."""

from types import SimpleNamespace

import numpy as np

from lidarcore.mapping.walls import along, distances, in_box, nearest

RNG = np.random.default_rng(0)
ENDS = np.concatenate(
    [
        RNG.uniform(-5, 5, (200, 2, 2)),
        # Along an axis, and without length.
        [[[-1.0, 2.0], [3.0, 2.0]], [[2.0, -4.0], [2.0, 4.0]], [[1.0, 1.0], [1.0, 1.0]]],
    ]
)
WALLS = SimpleNamespace(ends=ENDS, alpha=np.arctan2(*(ENDS[:, 0] - ENDS[:, 1]).T))
T = np.linspace(0, 1, 2001)
SAMPLES = ENDS[:, None, 0] + T[:, None] * (ENDS[:, 1] - ENDS[:, 0])[:, None]
STEP = 10 * np.sqrt(2) / 2000  # m between samples, at most


def test_distances_are_those_of_the_nearest_sample():
    for point in RNG.uniform(-7, 7, (20, 2)):
        sampled = np.hypot(*(SAMPLES - point).T).T.min(axis=1)
        found = distances(WALLS, point)
        assert (found <= sampled + 1e-12).all()
        assert (found >= sampled - STEP).all()
        order = nearest(WALLS, point, 7)
        np.testing.assert_array_equal(order, np.argsort(found, kind="stable")[:7])
    assert len(nearest(WALLS, (0, 0), 10_000)) == len(ENDS)


def test_a_wall_is_in_a_box_if_any_part_of_it_is():
    for _ in range(50):
        low, high = np.sort(RNG.uniform(-6, 6, (2, 2)), axis=0)
        sampled = ((low <= SAMPLES) & (high >= SAMPLES)).all(axis=-1).any(axis=1)
        found = in_box(WALLS, low, high)
        assert found[sampled].all()
        larger = ((low - STEP <= SAMPLES) & (high + STEP >= SAMPLES)).all(axis=-1).any(axis=1)
        assert larger[found].all()


def test_edges_belong_to_a_box():
    assert in_box(WALLS, (0, 2), (1, 5))[200]
    assert in_box(WALLS, (1, 1), (1, 1))[202]
    assert not in_box(WALLS, (0, 2.001), (1, 5))[200]


def test_a_direction_is_one_both_ways():
    ends = np.array([[[0, 0], [1, 0.0]], [[1, 0], [0, 0.05]], [[0, 0], [0, 1.0]], [[0, 0], [1, 1.0]]])
    walls = SimpleNamespace(ends=ends, alpha=np.arctan2(*(ends[:, 0] - ends[:, 1]).T))
    for turn in (0.0, np.pi, -np.pi, 2 * np.pi):
        np.testing.assert_array_equal(along(walls, turn, 0.1), [True, True, False, False])
    np.testing.assert_array_equal(along(walls, np.pi / 2, 0.01), [False, False, True, False])
