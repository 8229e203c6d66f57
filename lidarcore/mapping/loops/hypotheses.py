"""Where a node may be, seen from an earlier one: what was seen around both is registered on each other."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import chi_square_gate, relative
from lidarcore.mapping.graph.pose_graph import PoseGraph
from lidarcore.mapping.loops.consistency import Loop, squared
from lidarcore.mapping.loops.keyframes import Keyframe
from lidarcore.mapping.loops.passes import Passes
from lidarcore.mapping.matching.correlative import search
from lidarcore.mapping.matching.patches import Patches
from lidarcore.mapping.matching.registration import Registration, information_of, register
from lidarcore.mapping.matching.sight import agreement
from lidarcore.mapping.matching.surfels import Surfels, surfels
from lidarcore.mapping.settings import LoopSettings, MatchSettings

CAUTION = 4.0
"""A single wrong loop makes the graph surer than it should be: loops are looked for as if it were less sure."""
_CONFLICT = 0.2  # m by which a point must lie before a surface to contradict it
# The guess takes part with this many times its covariance, lest it is counted twice in the graph.
_WIDEN = 9.0
# A guess from the graph is never taken to be better than this: the search needs room.
_FLOOR = np.diag([0.05, 0.05, 0.02]) ** 2
_RIVAL = 0.85  # of a match's quality, from which on another place is a rival


class Hypotheses:
    """Of nodes of a graph, at earlier ones that its passes tell."""

    def __init__(
        self,
        graph: PoseGraph,
        keyframes: dict[int, Keyframe],
        passes: Passes,
        loops: LoopSettings,
        match: MatchSettings,
    ) -> None:
        self._graph, self._keyframes, self._passes = graph, keyframes, passes
        self._settings, self._match = loops, match
        self._gate = float(chi_square_gate(loops.gate, 3))

    def at(self, i: int, k: int, P: Array, seen: Patches, gated: bool = True) -> list[Loop]:
        """Where node k may be, seen from around node i: the best place, and its rival if that is nearly as good.

        P (3, 3) is the covariance of node k seen from node i, `seen` what was seen around it. Neither place may be
        where the graph does not expect it, if `gated`.
        """
        half = self._settings.before
        earlier = self._passes.seen(i, range(max(0, i - half), min(i + half + 1, k - self._settings.apart)))
        reference = surfels(earlier, self._match.patch, self._match.reach)
        mean = relative(self._graph.poses[i], self._graph.poses[k])

        def best(besides: Array) -> Loop | None:
            loop = self._registered(i, k, mean, P, reference, seen, besides)
            return loop if loop is None or not gated or self._is_expected(loop, mean, P) else None

        first = best(np.empty((0, 3)))
        if first is None:
            return []
        if not self._passes.is_vague(P):
            return [first]
        second = best(first.pose[None])
        if second is None or second.quality < _RIVAL * first.quality or self._same(first, second):
            return [first]
        return [first, second]

    def _registered(
        self, i: int, k: int, mean: Array, P: Array, reference: Surfels, seen: Patches, besides: Array
    ) -> Loop | None:
        """The best place besides others; None if it does not fit."""
        P = CAUTION * P + _FLOOR
        prior, match = information_of(_WIDEN * P), self._match
        start = search(reference.means, seen.means, mean, np.sqrt(np.diagonal(P)), match, besides)
        registered: Registration = register(reference, seen, start, mean, prior, match.reach)
        if registered.inliers < self._settings.inliers:
            return None
        conflicts = self._conflicts(i, k, registered.pose)
        if conflicts > self._settings.conflicts:
            return None
        C = information_of(registered.information) + self._settings.floor
        return Loop(i, k, registered.pose, C, registered.inliers - conflicts)

    def _is_expected(self, loop: Loop, mean: Array, P: Array) -> bool:
        """Whether a loop lies in the gate of where the graph has it: mean (3,) with covariance P (3, 3)."""
        return squared(loop.pose, mean, loop.covariance + CAUTION * P + _FLOOR) <= self._gate

    def _same(self, a: Loop, b: Loop) -> bool:
        """True if two poses are one, known only vaguely (along a corridor)."""
        return squared(a.pose, b.pose, a.covariance + b.covariance) < self._gate

    def _conflicts(self, i: int, k: int, pose: Array) -> float:
        """Largest share of either scan that lies where the other one looked through."""
        a, b = self._keyframes[i].sight, self._keyframes[k].sight
        there, back = (
            agreement(a, b, pose, _CONFLICT),
            agreement(b, a, relative(pose, np.zeros(3)), _CONFLICT),
        )
        return max(there[1], back[1])
