"""Earlier passes of a place that a new keyframe may have come back to, and what was seen on them."""

from itertools import pairwise

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import relative
from lidarcore.mapping.graph.known import JointPoses
from lidarcore.mapping.loops.consistency import spread
from lidarcore.mapping.loops.keyframes import Keyframe
from lidarcore.mapping.matching.patches import Patches, joined, placed
from lidarcore.mapping.matching.sight import agreement
from lidarcore.mapping.settings import VAGUE, LoopSettings, MatchSettings

_MARGIN = 0.3  # m by which surfaces may seem to be off where an overlap is guessed
# A relative pose known this well (m, m, rad) gains nothing from a loop.
_KNOWN = np.array([0.04, 0.04, 0.015])


class Passes:
    """Of the keyframes of a graph, by their nodes.

    match  a pose that three standard deviations leave open farther than its reach is too vague for its tie to be
           believed alone; what is vaguer than a search looks far would be found by chance only
    """

    def __init__(
        self, graph: JointPoses, keyframes: dict[int, Keyframe], settings: LoopSettings, match: MatchSettings
    ) -> None:
        self._graph, self._keyframes, self._settings = graph, keyframes, settings
        self._reach, self._farthest = match.reach, match.max_shift

    def worth_a_match(self, k: int) -> list[tuple[int, Array]]:
        """Earlier nodes to match node k with, and the covariance of k seen from there: the best of each pass nearby."""
        settings, poses = self._settings, self._graph.poses
        distances = np.hypot(*(poses[: max(k - settings.apart, 0), :2] - poses[k, :2]).T)
        found = []
        for run in map(self._kept, _runs(np.flatnonzero(distances < settings.farthest))):
            if not len(run):
                continue
            closest = int(run[np.argmin(distances[run])])
            P = self._graph.relative(closest, k)[1]
            radius = min(settings.distance + settings.sigmas * spread(P), settings.farthest)
            if distances[closest] > radius or not self._is_sought(P):
                continue
            best = self.best(run[distances[run] < radius], k, P)
            if best is None:
                continue
            if best != closest:  # from where node k may be known far better, or worse
                P = self._graph.relative(best, k)[1]
                if not self._is_sought(P):
                    continue
            found.append((float(np.linalg.det(P)), best, P))
        found.sort(key=lambda place: -place[0])
        return [(i, P) for _, i, P in found[: settings.places]]

    def _is_sought(self, P: Array) -> bool:
        """Whether a loop would tell anything that a search can find, where the graph knows a pose within P (3, 3)."""
        if P[2, 2] > VAGUE**2 or spread(P) > self._farthest or (np.diagonal(P) < _KNOWN**2).all():
            return False
        return bool(np.linalg.eigvalsh(P)[0] > 0)  # of islands, rounding may leave nothing

    def best(self, nodes: Ints, k: int, P: Array) -> int | None:
        """The node that saw most of what node k sees, or the nearest that saw enough; None if none did.

        P (3, 3) is the covariance of node k seen from there.
        """
        poses = self._graph.poses
        few, shares = self._shares(nodes, k, poses[k], _MARGIN + 2 * spread(P))
        enough = shares >= self._settings.overlap
        if not enough.any():
            return None
        if not self.is_vague(P):
            return int(few[np.argmax(shares)])
        # Seen from where the graph is vague, shares tell little more than that.
        distances = np.hypot(*(poses[few, :2] - poses[k, :2]).T)
        return int(few[np.argmin(np.where(enough, distances, np.inf))])

    def best_at(self, nodes: Ints, k: int, place: Array) -> int | None:
        """The node near a place (3,) that saw most of what node k would see from there; None if none saw enough."""
        near = np.hypot(*(self._graph.poses[nodes, :2] - place[:2]).T) < self._settings.distance
        few, shares = self._shares(nodes[near], k, place, _MARGIN)
        return int(few[np.argmax(shares)]) if shares.max(initial=0.0) >= self._settings.overlap else None

    def _shares(self, nodes: Ints, k: int, place: Array, margin: float) -> tuple[Ints, Array]:
        """A dozen of the nodes, and the share that each of them saw of what node k sees from a place (3,)."""
        nodes = self._kept(nodes)
        few, poses, sight = nodes[:: max(1, len(nodes) // 12)], self._graph.poses, self._keyframes[k].sight
        views = zip(few.tolist(), relative(poses[few], place), strict=True)
        return few, np.array([agreement(self._keyframes[i].sight, sight, T, margin)[0] for i, T in views])

    def is_vague(self, P: Array) -> bool:
        """Whether a pose with covariance P (3, 3) is known too little for its tie to be believed alone."""
        return bool(3 * spread(P) >= self._reach)

    def around(self, i: int, k: int, far: float) -> Ints:
        """Nodes of the pass of node i up to `far` m from it, and its neighbours; none that are of node k's own pass.

        An island may be joined to what was mapped just before it: node i itself is among them always.
        """
        half, poses = self._settings.before, self._graph.poses[: max(k - self._settings.apart, i + 1)]
        near = np.hypot(*(poses[:, :2] - poses[i, :2]).T) < far
        near[max(0, i - half) : i + half + 1] = True
        return next(run for run in _runs(np.flatnonzero(near)) if i in run)

    def seen(self, around: int, nodes: Ints) -> Patches:
        """What nodes saw together, seen from one of them."""
        kept = self._kept(nodes)
        several = [self._keyframes[node].patches for node in kept.tolist()]
        poses = relative(self._graph.poses[around], self._graph.poses[kept])
        each = np.repeat(poses, [len(seen.means) for seen in several], axis=0)
        return placed(joined(several), each).near

    def _kept(self, nodes: Ints) -> Ints:
        """Those of the nodes whose scans are still there."""
        if len(self._keyframes) == len(self._graph.poses):
            return nodes
        return np.array([node for node in nodes.tolist() if node in self._keyframes], np.int64)


def _runs(nodes: Ints) -> list[Ints]:
    """Successive numbers together, with small gaps."""
    edges = [0, *(np.flatnonzero(nodes[1:] - nodes[:-1] > 3) + 1).tolist(), len(nodes)]
    return [nodes[begin:end] for begin, end in pairwise(edges) if end > begin]
