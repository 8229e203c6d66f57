"""Which wall of a map is which of the last picture: ids that stay while the map grows and bends."""

from dataclasses import replace

import numpy as np

from lidarcore.mapping.grid.occupancy import Mask
from lidarcore.mapping.walls.observations import Observations, common
from lidarcore.mapping.walls.walls import Walls

_MOST = 0.5  # share of what was seen of a wall from which on that is the wall
_BESIDE = 0.3  # m from a wall that is gone within which another one stands in its place
_ALIKE = 0.9  # cosine of the angle between surfaces that face one way


class WallIds:
    """Gives the walls of each picture of one map the ids that they had, and new ones to new walls; none twice.

    A wall is known by the segments it was seen by, wherever the map has them. Where those were dropped, since keyframes
    that came later saw it elsewhere, it is the wall that stands beside. A wall that several have become keeps the
    oldest id; of those that one has become, the longest keeps it. One that is away for a while comes back with its id.
    """

    def __init__(self) -> None:
        self._known = Observations.none()  # of walls by their ids, as they were when last there
        self._last: Walls | None = None
        self._next = 0

    def identified(self, walls: Walls) -> Walls:
        """The walls of all keyframes so far, found with the same settings as those before, with their ids."""
        known, of = np.unique(self._known.wall, return_inverse=True)
        tied = _same(replace(self._known, wall=of), walls.observations, (len(known), len(walls)))
        away = ~tied.any(axis=1)
        if self._last is not None:
            gone = np.isin(self._last.ids, known[away])
            tied[np.searchsorted(known, self._last.ids[gone])] = _beside(self._last, walls)[gone]
        ids = np.full(len(walls), -1)
        for id, heirs in zip(known, tied, strict=True):
            left = np.flatnonzero(heirs & (ids < 0))
            if len(left):
                ids[left[np.argmax(walls.length[left])]] = id
        new = np.flatnonzero(ids < 0)
        ids[new] = self._next + np.arange(len(new))
        self._next += len(new)
        kept = self._known[np.isin(self._known.wall, known[~tied.any(axis=1)])]
        self._known = Observations.joined([kept, walls.observations.renamed(ids)])
        self._last = replace(walls, ids=ids)
        return self._last


def _same(before: Observations, now: Observations, shape: tuple[int, int]) -> Mask:
    """Which walls before and now (B, N) have most of either in common, as far as both could see it."""
    shared = common(before, now, shape).toarray()
    then = now[now.segment <= before.segment.max(initial=-1)]
    of_before, of_now = before.lengths(shape[0])[:, None], then.lengths(shape[1])
    return (shared > 0) & ((shared >= _MOST * of_before) | (shared >= _MOST * of_now))


def _beside(before: Walls, now: Walls) -> Mask:
    """Which walls before and now (B, N) face one way, close to each other over most of the shorter one."""
    way, way_before = (walls.ends[:, 1] - walls.ends[:, 0] for walls in (now, before))
    along = way / np.maximum(np.hypot(*way.T), 1e-12)[:, None]
    from_start = before.ends[:, None] - now.ends[:, :1]  # (B, N, 2, 2)
    t = (from_start * along[:, None]).sum(axis=-1)
    off = np.abs(from_start[..., 1] * along[:, :1] - from_start[..., 0] * along[:, 1:]).max(axis=-1)
    shared = np.minimum(t[..., 1], now.length) - np.maximum(t[..., 0], 0)
    shorter = np.minimum(before.length[:, None], now.length)
    alike = way_before @ along.T > _ALIKE * before.length[:, None]
    return alike & (off < _BESIDE) & (shared > _MOST * shorter)
