"""Sums of scores in the search for a pose, against numpy's own."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lidarcore.mapping.matching.scores import BLOCK, PAIRS, largest_ahead, sum_blocks, sum_scores


@given(st.integers(0, 2**32 - 1), st.integers(1, 50), st.integers(-40, 40), st.integers(-40, 40))
def test_scores_of_a_block_of_shifts_are_those_at_each_of_them(seed, count, u, v):
    """Where a point leaves the grid, whose outermost blocks are 0, it scores nothing."""
    rng = np.random.default_rng(seed)
    fine = np.zeros((5 * BLOCK, 7 * BLOCK), np.float32)
    fine[BLOCK:-BLOCK, BLOCK:-BLOCK] = rng.random((3 * BLOCK, 5 * BLOCK))
    cells, scores = rng.integers(-10, 60, (count, 2)), np.empty((BLOCK, BLOCK), np.float32)
    sum_scores(fine, largest_ahead(fine), cells, u, v, 1e9, -1.0, scores)
    wide = np.pad(fine, 200)
    expected = [
        [wide[200 + u + du + cells[:, 0], 200 + v + dv + cells[:, 1]].sum() for dv in range(BLOCK)]
        for du in range(BLOCK)
    ]
    np.testing.assert_allclose(scores, expected, atol=1e-4)


@given(st.integers(0, 2**32 - 1), st.integers(0, 5), st.integers(0, 9))
def test_what_a_block_cannot_exceed_is_the_sum_of_what_its_points_meet(seed, a, b):
    rng = np.random.default_rng(seed)
    ahead = rng.random((PAIRS, PAIRS, 6, 9)).astype(np.float32)
    cells = rng.integers(-10 * BLOCK, 12 * BLOCK, (2, 30, 2))
    sums = np.empty((2, 2 * a + 1, -(-(2 * b + 1) // BLOCK) * BLOCK), np.float32)
    sum_blocks(ahead, cells, np.array([a, b]), sums)
    wide, at = np.pad(ahead, [(0, 0), (0, 0), (40, 40), (40, 40)]), 40 + cells // BLOCK
    pairs = cells % BLOCK // 2
    for t, i, j in np.ndindex(2, 2 * a + 1, 2 * b + 1):
        expected = wide[pairs[t, :, 0], pairs[t, :, 1], at[t, :, 0] + i - a, at[t, :, 1] + j - b].sum()
        np.testing.assert_allclose(sums[t, i, j], expected, atol=1e-4)


@given(st.integers(0, 2**32 - 1))
def test_a_point_is_never_underrated_and_overrated_by_two_cells_at_most(seed):
    """Of ten cells along either side, it meets eight, wherever it lies in its pair."""
    rng = np.random.default_rng(seed)
    fine = rng.random((3 * BLOCK, 5 * BLOCK)).astype(np.float32)
    ahead, wide = largest_ahead(fine), np.pad(fine, [(0, 2 * BLOCK)] * 2)
    for i, j in rng.integers(0, fine.shape, (50, 2)):
        bound = ahead[i % BLOCK // 2, j % BLOCK // 2, i // BLOCK, j // BLOCK]
        assert bound >= wide[i : i + BLOCK, j : j + BLOCK].max()
        assert bound == wide[i - i % 2 :, j - j % 2 :][: BLOCK + 2, : BLOCK + 2].max()
