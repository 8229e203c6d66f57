"""Loops: which earlier places a new one is registered on, and which of these ties are believed.

What the last keyframes saw together is registered on what those of an earlier pass saw together. A tie must lie in the
chi-square gate of what the graph expects. Where the graph is too vague for that to exclude a wrong one, it waits until
others along a stretch of the way agree with it [Olson, ICRA 2009; Mangelson et al., ICRA 2018], and is believed only if
no rival that says something else has nearly as many that agree.
"""

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import chi_square_gate, relative
from lidarcore.mapping.graph.pose_graph import PoseGraph
from lidarcore.mapping.loops.consistency import Consistency, Loop, spread, squared, support
from lidarcore.mapping.loops.keyframes import Keyframe
from lidarcore.mapping.matching.correlative import search
from lidarcore.mapping.matching.patches import Patches, joined, placed
from lidarcore.mapping.matching.registration import Registration, information_of, register
from lidarcore.mapping.matching.sight import agreement
from lidarcore.mapping.matching.surfels import Surfels, surfels
from lidarcore.mapping.settings import VAGUE, LoopSettings, MatchSettings

_MARGIN = 0.3  # m by which surfaces may seem to be off where an overlap is guessed
_CONFLICT = 0.2  # m by which a point must lie before a surface to contradict it
# A relative pose known this well (m, m, rad) gains nothing from a loop.
_KNOWN = np.array([0.04, 0.04, 0.015])
# A single wrong loop makes the graph surer than it should be: loops are looked for as if it were less sure.
_CAUTION = 4.0
_WIDEN = (
    9.0  # the guess takes part with this many times its covariance, lest it is counted twice in the graph
)
# A guess from the graph is never taken to be better than this: the search needs room.
_FLOOR = np.diag([0.05, 0.05, 0.02]) ** 2
_ALONE = 0.2  # of the support of the last loops, which all that contradict them may have together
_RIVAL = 0.85  # of a match's quality, from which on another place is a rival


class LoopFinder:
    """Ties nodes of a graph to earlier ones."""

    def __init__(
        self, graph: PoseGraph, keyframes: dict[int, Keyframe], loops: LoopSettings, match: MatchSettings
    ) -> None:
        self._graph, self._keyframes, self._settings, self._match_settings = graph, keyframes, loops, match
        self._waiting: list[Loop] = []
        self._gate = float(chi_square_gate(loops.gate, 3))

    def find(self, k: int) -> list[Loop]:
        """Loops to believe after node k came in; some of them may be of the nodes just before it."""
        believed: list[Loop] = []
        places = self._places(k)
        seen = self._submap(k, range(max(0, k - self._settings.before), k + 1)) if places else None
        for i, P in places:
            assert seen is not None
            for loop in self._hypotheses(i, k, P, seen):
                (self._waiting if self._is_vague(P) else believed).append(loop)
        if self._waiting and self._waiting[-1].j == k:
            believed += self._agreeing(k)
        return believed

    def tie(self, nodes: Ints, k: int, P: Array) -> Loop | None:
        """Node k registered on the earlier node that saw most of the same; the graph has it right within P (3, 3)."""
        nodes = self._kept(nodes)
        i = self._best(nodes, k, P) if len(nodes) else None
        if i is None:
            return None
        seen = self._submap(k, range(max(0, k - self._settings.before), k + 1))
        return next(iter(self._hypotheses(i, k, P, seen)), None)

    def conclude(self) -> list[Loop]:
        """Loops to believe of the last nodes, which no further ones will support: all fit, and nothing else does.

        The newest scans alone are registered on each earlier pass, wherever a search looks: by then the drive may have
        gone farther astray than the graph knows, so that it did not expect a loop decides nothing.
        """
        way, found = self._way(), []
        for k in range(max(1, len(way) - 2 * self._settings.apart), len(way)):
            if way[-1] - way[k] > self._settings.shortest:
                continue
            seen = self._submap(k, range(k - 1, k + 1))
            for i, P in self._places(k):
                if 3 * spread(P) < self._match_settings.max_shift:
                    found += self._hypotheses(i, k, P, seen, gated=False)
        consistency = Consistency(self._graph, self._gate)
        best = max((consistency.agreeing(loop, found) for loop in found), key=support, default=[])
        rivals = [loop for loop in found if not any(loop is member for member in best)]
        alone = sum(loop.quality for loop in rivals) <= _ALONE * sum(loop.quality for loop in best)
        self._waiting = []
        return best if alone and len({loop.j for loop in best}) > 1 else []

    def _places(self, k: int) -> list[tuple[int, Array]]:
        """Earlier nodes worth a match, with the covariance of k seen from there: the best of each pass nearby."""
        settings, poses = self._settings, self._graph.poses
        distances = np.hypot(*(poses[: max(k - settings.apart, 0), :2] - poses[k, :2]).T)
        found = []
        for run in map(self._kept, _runs(np.flatnonzero(distances < settings.farthest))):
            if not len(run):
                continue
            closest = int(run[np.argmin(distances[run])])
            P = self._graph.relative(closest, k)[1]
            if P[2, 2] > VAGUE**2:
                continue
            radius = settings.distance + settings.sigmas * spread(P)
            if distances[closest] > min(radius, settings.farthest) or (np.diagonal(P) < _KNOWN**2).all():
                continue
            near = run[distances[run] < min(radius, settings.farthest)]
            best = self._best(near, k, P)
            if best is not None:
                found.append((float(np.linalg.det(P)), best, P))
        found.sort(key=lambda place: -place[0])
        return [(i, P) for _, i, P in found[: settings.places]]

    def _best(self, run: Ints, k: int, P: Array) -> int | None:
        """The node of a run that saw most of what node k sees, or the nearest that saw enough; None if none did."""
        poses, margin = self._graph.poses, _MARGIN + 2 * spread(P)
        few = run[:: max(1, len(run) // 12)]
        shares = [
            agreement(
                self._keyframes[i].sight, self._keyframes[k].sight, relative(poses[i], poses[k]), margin
            )[0]
            for i in few
        ]
        enough = np.array(shares) >= self._settings.overlap
        if not enough.any():
            return None
        if not self._is_vague(P):
            return int(few[np.argmax(shares)])
        # Seen from where the graph is vague, shares tell little more than that.
        distances = np.hypot(*(poses[few, :2] - poses[k, :2]).T)
        return int(few[np.argmin(np.where(enough, distances, np.inf))])

    def _is_vague(self, P: Array) -> bool:
        """Whether a pose with covariance P (3, 3) is known too little for its tie to be believed alone."""
        return bool(3 * spread(P) >= self._match_settings.reach)

    def _submap(self, around: int, nodes: range) -> Patches:
        """What nodes saw together, seen from one of them."""
        kept = self._kept(np.array(nodes))
        poses = relative(self._graph.poses[around], self._graph.poses[kept])
        return joined([placed(self._keyframes[n].patches.near, x) for n, x in zip(kept, poses, strict=True)])

    def _kept(self, nodes: Ints) -> Ints:
        """Those of the nodes whose scans are still there."""
        there: Ints = nodes[np.array([n in self._keyframes for n in nodes.tolist()], bool)]
        return there

    def _hypotheses(self, i: int, k: int, P: Array, seen: Patches, gated: bool = True) -> list[Loop]:
        """Where node k may be, seen from around node i: the best place, and its rival if that is nearly as good.

        Neither may be where the graph does not expect it, if `gated`.
        """
        half = self._settings.before
        nodes = range(max(0, i - half), min(i + half + 1, k - self._settings.apart))
        match = self._match_settings
        earlier = self._submap(i, nodes)
        reference = surfels(earlier, match.patch, match.reach)
        mean = relative(self._graph.poses[i], self._graph.poses[k])

        def best(besides: Array) -> Loop | None:
            loop = self._registered(i, k, mean, P, reference, seen, besides)
            return loop if loop is None or not gated or self._is_expected(loop, mean, P) else None

        first = best(np.empty((0, 3)))
        if first is None:
            return []
        if not self._is_vague(P):
            return [first]
        second = best(first.pose[None])
        if second is None or second.quality < _RIVAL * first.quality or self._same(first, second):
            return [first]
        return [first, second]

    def _is_expected(self, loop: Loop, mean: Array, P: Array) -> bool:
        """Whether a loop lies in the gate of where the graph has it: mean (3,) with covariance P (3, 3)."""
        return squared(loop.pose, mean, loop.covariance + _CAUTION * P + _FLOOR) <= self._gate

    def _same(self, a: Loop, b: Loop) -> bool:
        """True if two poses are one, known only vaguely (along a corridor)."""
        return squared(a.pose, b.pose, a.covariance + b.covariance) < self._gate

    def _registered(
        self, i: int, k: int, mean: Array, P: Array, reference: Surfels, seen: Patches, besides: Array
    ) -> Loop | None:
        """The best place besides others; None if it does not fit."""
        P = _CAUTION * P + _FLOOR
        prior, match = information_of(_WIDEN * P), self._match_settings
        start = search(reference.means, seen.means, mean, np.sqrt(np.diagonal(P)), match, besides)
        registered: Registration = register(reference, seen, start, mean, prior, match.reach)
        if registered.inliers < self._settings.inliers:
            return None
        conflicts = self._conflicts(i, k, registered.pose)
        if conflicts > self._settings.conflicts:
            return None
        C = information_of(registered.information) + self._settings.floor
        return Loop(i, k, registered.pose, C, registered.inliers - conflicts)

    def _conflicts(self, i: int, k: int, pose: Array) -> float:
        """Largest share of either scan that lies where the other one looked through."""
        a, b = self._keyframes[i].sight, self._keyframes[k].sight
        there, back = (
            agreement(a, b, pose, _CONFLICT),
            agreement(b, a, relative(pose, np.zeros(3)), _CONFLICT),
        )
        return max(there[1], back[1])

    def _agreeing(self, k: int) -> list[Loop]:
        """The waiting loops that fit each other, if they reach far enough and no rivals do; they wait no more."""
        way = self._way()
        self._waiting = [loop for loop in self._waiting if way[k] - way[loop.j] < self._settings.memory]
        new = [loop for loop in self._waiting if loop.j == k]
        consistency = Consistency(self._graph, self._gate)
        sets = [consistency.agreeing(loop, self._waiting) for loop in new]
        best = max(sets, key=support)
        expected, P = self._graph.relative(best[0].i, k)
        off = max(spread(P), float(np.hypot(*(best[0].pose - expected)[:2])))
        stretch = np.clip(self._settings.sigmas * off, *self._settings.stretch)
        nodes = {loop.j for loop in best}
        if len(nodes) < self._settings.support or way[max(nodes)] - way[min(nodes)] < stretch:
            return []
        members = {id(loop) for loop in best}
        others = [
            loop for loop in self._waiting if id(loop) not in members and min(nodes) <= loop.j <= max(nodes)
        ]
        against = [loop for loop in others if not any(consistency.agree(loop, b) for b in best)]
        rivals = [consistency.agreeing(loop, self._waiting) for loop in against]
        if any(support(rival) > self._settings.rivals * self._worth(best, rival) for rival in rivals):
            return []
        self._waiting = [loop for loop in self._waiting if id(loop) not in members]
        return best

    def _worth(self, loops: list[Loop], rival: list[Loop]) -> float:
        """The support of loops, less where the graph expects a rival rather than them."""
        surprise, less = (self._surprise(several[0]) for several in (loops, rival))
        return support(loops) * min(1.0, float(np.exp((less - surprise) / 2)))

    def _surprise(self, loop: Loop) -> float:
        """Squared Mahalanobis distance of a loop from what the graph expects."""
        expected, P = self._graph.relative(loop.i, loop.j)
        return squared(loop.pose, expected, loop.covariance + _CAUTION * P)

    def _way(self) -> Array:
        """Metres travelled to each node."""
        steps = np.diff(self._graph.poses[:, :2], axis=0)
        return np.concatenate([[0.0], np.cumsum(np.hypot(*steps.T))])


def _runs(nodes: Ints) -> list[Ints]:
    """Successive numbers together, with small gaps."""
    return [run for run in np.split(nodes, np.flatnonzero(np.diff(nodes) > 3) + 1) if len(run)]
