"""Which patches are of one piece of surface, against a search of each stretch by itself."""

import numpy as np

from lidarcore.mapping.cells import cells

SIZE, GAP = 0.5, 0.1  # m


def test_patches_are_of_one_cell_where_no_gap_parts_them_across_their_stretch_of_a_surface():
    rng = np.random.default_rng(0)
    places = rng.uniform(-3, 3, (600, 2))
    side = rng.integers(0, 2, 600)  # surfaces that look to the right, and ahead
    number = cells(places, np.eye(2)[side], SIZE, GAP)
    across = np.where(side == 0, places[:, 0], places[:, 1])
    along = np.where(side == 0, places[:, 1], -places[:, 0])
    expected = set()
    for stretch in set(zip(side, np.floor(along / SIZE), strict=True)):
        inside = np.flatnonzero((side == stretch[0]) & (np.floor(along / SIZE) == stretch[1]))
        piece = []
        for k in sorted(inside.tolist(), key=lambda k: across[k]):
            if piece and across[k] - across[piece[-1]] > GAP:
                expected.add(frozenset(piece))
                piece = []
            piece.append(k)
        expected.add(frozenset(piece))
    assert {frozenset(np.flatnonzero(number == n).tolist()) for n in np.unique(number)} == expected
    assert len(expected) > 100


def test_no_patches_are_of_no_cell():
    assert len(cells(np.empty((0, 2)), np.empty((0, 2)), SIZE, GAP)) == 0
