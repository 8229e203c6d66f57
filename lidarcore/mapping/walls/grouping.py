"""Which segments are of one wall: those that lie along the line of the longest, and follow on each other."""

from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Ints
from lidarcore.geometry import wrap
from lidarcore.mapping.walls.fitting import Fit, fit_line
from lidarcore.mapping.walls.pieces import Pieces
from lidarcore.mapping.walls.settings import WallSettings

_ROUNDS = 8
_ALIKE = 0.35  # rad that the normals of a wall and of its segments differ by at most


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Segments (N,) of one wall, by their number, and the line through them."""

    members: Ints
    fit: Fit


def group_pieces(pieces: Pieces, settings: WallSettings) -> list[Group]:
    """Every segment in one group, the longest segments first: the result does not depend on the order of scans."""
    lengths = np.linalg.norm(pieces.ends[:, 1] - pieces.ends[:, 0], axis=-1)
    left = np.ones(len(pieces), bool)
    groups = []
    for seed in np.argsort(-lengths, kind="stable"):
        if left[seed]:
            group = _grown(pieces, int(seed), np.flatnonzero(left), settings)
            left[group.members] = False
            groups.append(group)
    return groups


def _grown(pieces: Pieces, seed: int, candidates: Ints, settings: WallSettings) -> Group:
    """The wall around a segment: its line is fitted to what lies along it, until that stays the same."""
    members = np.array([seed])
    for _ in range(_ROUNDS):
        fit = fit_line(pieces, members)
        found = _along(pieces, fit, seed, candidates, settings)
        if np.array_equal(found, members):
            break
        members = found
    return Group(members, fit_line(pieces, members))


def _along(pieces: Pieces, fit: Fit, seed: int, candidates: Ints, settings: WallSettings) -> Ints:
    """The candidates along a line that follow on each other from the seed on, the seed among them."""
    t, distance = fit.coordinates(pieces.ends[candidates])
    turned = np.abs(wrap(pieces.alpha[candidates] - fit.alpha))
    near = (np.abs(distance).max(axis=1) <= settings.distance) & (turned < _ALIKE) | (candidates == seed)
    close, low, high = candidates[near], t[near].min(axis=1), t[near].max(axis=1)
    order = np.argsort(low, kind="stable")
    reach = np.maximum.accumulate(high[order])
    run = np.concatenate([[0], np.cumsum(low[order][1:] > reach[:-1] + settings.gap)])
    own = run[np.flatnonzero(close[order] == seed)[0]]
    return np.sort(close[order][run == own])
