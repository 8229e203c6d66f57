"""Islands: what is mapped after the sensor may have been carried elsewhere, until it is found in the map before.

How an island lies is open, often by half a turn: no loop from a guess would find it. So it is looked for without one,
as a robot that was switched on anywhere, and believed where two views of it that share no keyframe say the same.
"""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import UncertainPose, compose, inverse, pose_difference, relative
from lidarcore.mapping.graph.pose_graph import PoseGraph
from lidarcore.mapping.grid.builder import build_grid
from lidarcore.mapping.loops.keyframes import Keyframe
from lidarcore.mapping.relocation import Relocator, query_of

_TOGETHER = 6  # keyframes that are looked for together, and that an island has at least
_EVERY = 3  # keyframes: an island is looked for when so many have come since the last time
_APART = 1.0  # m between two views of an island
_ANY = np.pi / np.sqrt(3)  # rad, standard deviation of a heading that may be any
_SAME, _SAME_TURN = 0.3, 0.1  # m and rad within which they say the same


class Found(NamedTuple):
    """Where node k of the newest island was found: T_world_k (3,), by the map of another island."""

    k: int
    island: int
    pose: Array


class Islands:
    """Which island each node of a graph is on, and where the newest one lies in the others."""

    def __init__(self, graph: PoseGraph, keyframes: dict[int, Keyframe]) -> None:
        self._graph, self._keyframes = graph, keyframes
        self._begins: list[tuple[int, int]] = [(0, 0)]  # first node of a stretch, and its island
        self._shores: list[int] = [0]  # the node on which each island hangs
        self._relocators: dict[int, Relocator] = {}
        self._views: list[Found] = []

    @property
    def numbers(self) -> Ints:
        """(K,) the island that each node is on, from 0."""
        begins, islands = np.array(self._begins).T
        numbers: Ints = islands[np.searchsorted(begins, np.arange(len(self._graph)), side="right") - 1]
        return numbers

    def shore(self, node: int, tie: UncertainPose) -> tuple[int, UncertainPose]:
        """On which node an island hangs that comes after `node`, at a tie T_node_island, and T_shore_island.

        That of an island before it, if `node` is on one: hung on each other, some dozens would be so uncertain together
        that rounding leaves nothing of the relative poses on them.
        """
        shore = node
        if island := int(self.numbers[node]):
            shore = self._shores[island]
            tie = self._graph.relative(shore, node).compose(tie)
        at_most = np.diag([1.0, 1.0, min(1.0, _ANY / np.sqrt(tie.covariance[2, 2]))])
        return shore, UncertainPose(tie.pose, at_most @ tie.covariance @ at_most)

    def begin(self, node: int, shore: int) -> None:
        """What comes from this node on is an island that hangs on another node."""
        self._begins.append((node, len(self._shores)))
        self._shores.append(shore)
        self._relocators.clear()
        self._views.clear()

    def join(self, found: Found) -> None:
        """The newest island is part of the one that it was found in from now on."""
        newest = self._begins[-1][1]
        self._begins = [(b, found.island if one == newest else one) for b, one in self._begins]
        self._relocators.clear()
        self._views.clear()

    def find(self, k: int) -> Found | None:
        """Where node k of the newest island lies; None if it has always been there, or that cannot be told."""
        numbers = self.numbers[: k + 1]
        newest = self._begins[-1][1]
        size = int((numbers == newest).sum())
        if newest == 0 or size < _TOGETHER or size % _EVERY:
            return None
        nodes = np.flatnonzero(numbers == newest)[-_TOGETHER:]
        poses = self._graph.poses
        query = query_of([self._keyframes[n].scan for n in nodes], poses[nodes])
        for island in range(newest - 1, -1, -1):
            ground = np.flatnonzero(numbers == island)
            if len(ground) < _TOGETHER:
                continue
            if island not in self._relocators:
                kept = [n for n in ground.tolist() if n in self._keyframes]
                scans = [self._keyframes[n].scan for n in kept]
                self._relocators[island] = Relocator(build_grid(scans, poses[kept]))
            at = self._relocators[island].find(query)
            if at.found:
                return self._confirmed(Found(k, island, at.pose), poses)
        return None

    def _confirmed(self, found: Found, poses: Array) -> Found | None:
        """What was found, if an earlier view from elsewhere says the same; one that does not ends what was believed.

        Views that share keyframes are one: what looks alike in a corridor that is driven the other way does in both.
        """
        if not all(_agree(view, found, poses) for view in self._views):
            self._views.clear()
        others = [poses[view.k] for view in self._views if found.k - view.k >= _TOGETHER]
        self._views.append(found)
        way = [np.hypot(*(other - poses[found.k])[:2]) for other in others]
        return found if max(way, default=0.0) >= _APART else None


def moved(poses: Array, nodes: Ints, found: Found) -> Array:
    """Poses (K, 3) with these nodes moved as one, so that node k lies where it was found."""
    after = poses.copy()
    after[nodes] = compose(compose(found.pose, inverse(poses[found.k])), poses[nodes])
    return after


def _agree(a: Found, b: Found, poses: Array) -> bool:
    x, y, turn = pose_difference(relative(a.pose, b.pose), relative(poses[a.k], poses[b.k]))
    return bool(a.island == b.island and np.hypot(x, y) < _SAME and abs(turn) < _SAME_TURN)
