"""Loops: which ties to earlier places are believed.

What the last keyframes saw together is registered on what those of an earlier pass saw together, and the newest scan
alone from there. A tie must lie in the chi-square gate of what the graph expects. Where the graph is too vague for that
to exclude a wrong one, it waits until others along a stretch of the way agree with it [Olson, ICRA 2009; Mangelson et
al., ICRA 2018], and is believed only if no rival that says something else has nearly as many that agree.
"""

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import UncertainPose, chi_square_gate
from lidarcore.mapping.graph.known import JointPoses
from lidarcore.mapping.loops.consistency import Consistency, Loop, spread, squared, support
from lidarcore.mapping.loops.hypotheses import CAUTION, Hypotheses
from lidarcore.mapping.loops.keyframes import Keyframe
from lidarcore.mapping.loops.passes import Passes
from lidarcore.mapping.loops.tried import Tried
from lidarcore.mapping.matching.patches import Patches
from lidarcore.mapping.settings import LoopSettings, MatchSettings

_ALONE = 0.2  # of the support of the last loops, which all that contradict them may have together


class LoopFinder:
    """Ties nodes of a graph to earlier ones."""

    def __init__(
        self, graph: JointPoses, keyframes: dict[int, Keyframe], loops: LoopSettings, match: MatchSettings
    ) -> None:
        self._graph, self._settings, self._farthest = graph, loops, match.max_shift
        self._passes = Passes(graph, keyframes, loops, match)
        self._hypotheses = Hypotheses(graph, keyframes, self._passes, loops, match)
        self._waiting: list[Loop] = []
        self._tried = Tried()
        self._gate = float(chi_square_gate(loops.gate, 3))

    def find(self, k: int) -> list[Loop]:
        """Loops to believe after node k came in; some of them may be of the nodes just before it."""
        believed: list[Loop] = []
        places = self._passes.worth_a_match(k)
        seen = self._seen(k, self._settings.before) if places else None
        for i, P in places:
            assert seen is not None
            for loop in self._at(i, k, P, seen):
                (self._waiting if self._passes.is_vague(P) else believed).append(loop)
        if self._waiting and self._waiting[-1].j == k:
            believed += self._agreeing(k)
        return believed

    def find_first(self, nodes: Ints) -> list[Loop]:
        """Loops to believe after these nodes came in, up to some way behind the first one.

        What those tell of the graph makes others easier to find, or shows that nobody needs them.
        """
        way, found = self._way(), list[Loop]()
        for k in nodes.tolist():
            if found and way[k] - way[found[0].j] > self._settings.longest:
                return found
            found += self.find(k)
        return found + self.conclude()

    def tie(self, nodes: Ints, k: int, P: Array) -> Loop | None:
        """Node k registered on the earlier node that saw most of the same; the graph has it right within P (3, 3)."""
        i = self._passes.best(nodes, k, P)
        if i is None:
            return None
        return next(iter(self._hypotheses.at(i, k, P, self._seen(k, self._settings.before))), None)

    def conclude(self) -> list[Loop]:
        """Loops to believe of the last nodes, which no further ones will support: all fit, and nothing else does.

        The newest scans alone are registered on each earlier pass, wherever a search looks: by then the drive may have
        gone farther astray than the graph knows, so that it did not expect a loop decides nothing.
        """
        way, found = self._way(), []
        for k in range(max(1, len(way) - 2 * self._settings.apart), len(way)):
            if way[-1] - way[k] > self._settings.shortest:
                continue
            seen = self._seen(k, 1)
            for i, P in self._passes.worth_a_match(k):
                if 3 * spread(P) < self._farthest:
                    found += self._hypotheses.at(i, k, P, seen, gated=False)
        consistency = Consistency(self._graph, self._gate)
        best = max((consistency.agreeing(loop, found) for loop in found), key=support, default=[])
        rivals = [loop for loop in found if not any(loop is member for member in best)]
        alone = sum(loop.quality for loop in rivals) <= _ALONE * sum(loop.quality for loop in best)
        self._waiting = []
        return best if alone and len({loop.j for loop in best}) > 1 else []

    def _at(self, i: int, k: int, P: Array, seen: Patches) -> list[Loop]:
        """Where node k may be, on the pass of node i; P (3, 3) and `seen` as there."""
        expected = UncertainPose(self._graph.relative(i, k)[0], P)
        found = self._tried.get(i, k, expected)
        if found is None:
            found = self._hypotheses.at(i, k, P, seen)
            self._tried.put(i, k, expected, found)
        return found

    def _seen(self, k: int, before: int) -> Patches:
        """What node k and so many before it saw together, seen from node k."""
        return self._passes.seen(k, np.arange(max(0, k - before), k + 1))

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
        return squared(loop.pose, expected, loop.covariance + CAUTION * P)

    def _way(self) -> Array:
        """Metres travelled to each node."""
        steps = np.diff(self._graph.poses[:, :2], axis=0)
        return np.concatenate([[0.0], np.cumsum(np.hypot(*steps.T))])
