from itertools import product

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from lidarcore.geometry import chi_square_gate, squared_mahalanobis
from lidarcore.localization import LocalizationSettings
from lidarcore.localization.ekf.association import associate, worst_pair

SETTINGS = LocalizationSettings()
GATE, FAR = chi2.ppf([SETTINGS.gate, SETTINGS.new_gate], 2)


@given(st.floats(0.01, 0.9999), st.integers(1, 40))
def test_the_gate_is_the_quantile_of_the_chi_square_law(probability: float, dimension: int) -> None:
    np.testing.assert_allclose(
        chi_square_gate(probability, dimension), chi2.ppf(probability, dimension), rtol=1e-9
    )


def test_the_gate_lets_through_the_share_of_true_pairs_that_it_names() -> None:
    rng = np.random.default_rng(0)
    S = np.array([[0.04, 0.03], [0.03, 0.09]])
    errors = rng.multivariate_normal([0, 0], S, 100_000, method="cholesky")
    inside = (squared_mahalanobis(errors, S) < chi_square_gate(0.99)).mean()
    assert abs(inside - 0.99) < 4 * np.sqrt(0.99 * 0.01 / 100_000)


@given(st.integers(0, 2**32 - 1))
def test_the_assignment_is_the_best_of_all_one_to_one_pairings(seed: int) -> None:
    rng = np.random.default_rng(seed)
    K, L = rng.integers(0, 5, 2)
    distances = rng.choice([0.5, 2.0, 5.0, 8.0, 15.0, 40.0], (K, L)) * rng.uniform(0.9, 1.1, (K, L))
    found = associate(distances, SETTINGS)
    pairs = [*zip(found.observed, found.landmark, strict=True), *map(tuple, found.ambiguous)]

    def cost(choice: tuple[int, ...]) -> float:
        taken = [j for j in choice if j < L]
        if len(set(taken)) < len(taken) or any(
            distances[i, j] >= GATE for i, j in enumerate(choice) if j < L
        ):
            return np.inf
        return float(sum(distances[i, j] if j < L else FAR for i, j in enumerate(choice)))

    chosen = [L] * K
    for i, j in pairs:
        chosen[i] = j
    best = min(cost(choice) for choice in product(range(L + 1), repeat=K))
    np.testing.assert_allclose(cost(tuple(chosen)), best, rtol=1e-12)
    groups = np.concatenate([found.observed, found.ambiguous[:, 0], found.unmatched, found.new])
    assert sorted(groups) == list(range(K))


def test_a_pair_with_a_rival_almost_as_likely_is_ambiguous_and_not_used() -> None:
    found = associate(np.array([[1.0, 2.0, 90.0], [90.0, 90.0, 0.1]]), SETTINGS)
    assert found.ambiguous.tolist() == [[0, 0]]
    assert (found.observed.tolist(), found.landmark.tolist()) == ([1], [2])


def test_a_rival_that_another_observation_explains_far_better_leaves_no_doubt() -> None:
    found = associate(np.array([[1.0, 2.0], [90.0, 0.1]]), SETTINGS)
    assert len(found.ambiguous) == 0
    assert found.landmark.tolist() == [0, 1]


def test_what_is_near_but_outside_the_gate_is_neither_matched_nor_new() -> None:
    found = associate(np.array([[GATE + 1], [FAR + 1]]), SETTINGS)
    assert (found.unmatched.tolist(), found.new.tolist()) == ([0], [1])


@given(st.integers(0, 2**32 - 1))
def test_the_worst_pair_is_the_one_whose_removal_lowers_the_joint_distance_most(seed: int) -> None:
    rng = np.random.default_rng(seed)
    P = int(rng.integers(2, 7))
    root = rng.normal(size=(2 * P, 2 * P))
    S, innovation = root @ root.T + np.eye(2 * P), 20 * rng.normal(size=2 * P)

    def joint(without: int) -> float:
        rows = np.delete(np.arange(2 * P), [2 * without, 2 * without + 1])
        return float(innovation[rows] @ np.linalg.solve(S[np.ix_(rows, rows)], innovation[rows]))

    worst = worst_pair(innovation, np.linalg.inv(S), 0.99)
    if innovation @ np.linalg.solve(S, innovation) <= chi2.ppf(0.99, 2 * P):
        assert worst is None
    else:
        assert worst is not None
        np.testing.assert_allclose(joint(worst), min(joint(i) for i in range(P)), rtol=1e-6)
