"""A sparse factor against dense algebra."""

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array, random_array

from lidarcore.mapping.graph.factor import Factor

PAIRS = np.append(np.arange(30), 30 + np.arange(30) // 2)


def made(seed, unknowns=60) -> csc_array:
    """A random information matrix that is mostly empty."""
    rng = np.random.default_rng(seed)
    half = random_array((unknowns, unknowns), density=0.02, rng=rng)
    half = half + diags_array(rng.uniform(0.5, 1, unknowns))
    return csc_array(half @ half.T)


@pytest.mark.parametrize("asked", [60, 24])
@pytest.mark.parametrize("seed", range(5))
def test_blocks_of_the_inverse_are_those_of_the_dense_one_or_not_given_whatever_the_pattern(seed, asked):
    H = made(seed)
    found = Factor(H, asked)
    inverse = np.linalg.inv(H.toarray())[:asked, :asked]
    own, blocks = found.blocks(), asked // 3
    expected = np.array([inverse[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(blocks)])
    given = np.isfinite(own)
    assert given[:, range(3), range(3)].mean() > 0.5
    np.testing.assert_allclose(own[given], expected[given], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("groups", [None, PAIRS])
@pytest.mark.parametrize("asked", [60, 24])
@pytest.mark.parametrize("seed", range(5))
def test_solutions_and_columns_are_those_of_the_dense_inverse_of_what_is_asked_for(seed, asked, groups):
    H = made(seed)
    found, rng = Factor(H, asked, groups), np.random.default_rng(seed)
    assert len(found) == asked
    inverse = np.linalg.inv(H.toarray())[:asked, :asked]
    for count in (3, 12):
        columns = np.hstack([found.columns(k, count) for k in range(0, asked, count)])
        np.testing.assert_allclose(columns, inverse, rtol=1e-6, atol=1e-9)
    for shape in ((asked,), (asked, 1), (asked, 4)):
        b = rng.normal(size=shape)
        fresh = Factor(H, asked, groups)  # of which no entries were asked for
        for solved in (found.solve(b), fresh.solve(b)):
            np.testing.assert_allclose(solved, inverse @ b, rtol=1e-6, atol=1e-9)


def test_each_column_begins_with_its_diagonal():
    found = Factor(made(0, 300)).lower
    np.testing.assert_array_equal(found.rows[found.begins[:-1]], np.arange(300))
    np.testing.assert_array_equal(found.values[found.begins[:-1]], 1.0)


def test_groups_are_eliminated_as_one_in_an_order_that_fills_little():
    """An arrow, whose tip would fill everything if it went first."""
    H = np.diag(np.full(60, 61.0))
    H[:2, :] += 1.0
    H[:, :2] += 1.0
    lower = Factor(csc_array(H), groups=np.append([0, 0], 1 + np.arange(58))).lower
    assert set(lower.order[:2]) == {58, 59}
    assert len(lower.rows) <= 60 + 2 * 58 + 1


def test_a_factor_keeps_nothing_else_alive():
    """A view into SuperLU's own numbers would: twice as much memory as the factor itself."""
    for column in Factor(made(1)).lower:
        while column.base is not None:
            column = column.base
            assert isinstance(column, np.ndarray)
