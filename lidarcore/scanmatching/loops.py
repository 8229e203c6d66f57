"""Loops: which earlier scans a new one is matched with, and which of the matches are believed.

A match must lie in the chi-square gate of what the graph expects. Where the graph is too vague for that to exclude a
wrong match, it waits until others agree with it: all loops of a set must pairwise fit [Olson, ICRA 2009; Mangelson et
al., ICRA 2018].
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from lidarcore.poses import compose, inverse
from lidarcore.scan import Array, Ints
from lidarcore.scanmatching.matching import match_scans
from lidarcore.scanmatching.pairing import agreement
from lidarcore.scanmatching.pose_graph import PoseGraph
from lidarcore.scanmatching.settings import ScanSlamSettings
from lidarcore.scanmatching.surface import Surface
from lidarcore.scanmatching.uncertain import chain, squared_distance

_MARGIN = 0.3  # m by which surfaces may seem to be off where an overlap is guessed
# A relative pose known this well (m, m, rad) gains nothing from a match.
_KNOWN = np.array([0.01, 0.01, 0.005])
# A single wrong match makes the graph surer than it should be: loops are looked for as if it were less sure.
_CAUTION = 4.0
# A guess from the graph is never taken to be better than this: the search needs room.
_FLOOR = np.diag([0.02, 0.02, 0.01]) ** 2


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """T_i_j (3,) with its covariance (3, 3), of an earlier node i and a later node j."""

    i: int
    j: int
    pose: Array
    covariance: Array


class LoopFinder:
    """Ties each new node of a graph to earlier ones."""

    def __init__(self, graph: PoseGraph, surfaces: list[Surface], settings: ScanSlamSettings) -> None:
        self._graph, self._surfaces, self._settings = graph, surfaces, settings
        self._waiting: list[Loop] = []
        self._gate = float(chi2.ppf(settings.loops.gate, 3))

    def find(self, k: int) -> list[Loop]:
        """Loops to believe after node k came in; some of them may be of the nodes just before it."""
        self._waiting = [loop for loop in self._waiting if loop.j > k - self._settings.loops.memory]
        believed = []
        for i in self._places(k):
            mean, P = self._graph.relative(i, k)
            P *= _CAUTION
            loop = self._match(i, k, mean, P)
            if loop is None:
                continue
            if 3 * np.sqrt(P[0, 0] + P[1, 1]) < self._settings.match.reach:
                believed.append(loop)
            else:
                self._waiting.append(loop)
                believed += self._agreeing(loop)
        return believed

    def _places(self, k: int) -> list[int]:
        """Earlier nodes worth a match: the best one of each pass nearby, the most uncertain ones first."""
        settings, poses = self._settings.loops, self._graph.poses
        distances = np.hypot(*(poses[: max(k - 1, 0), :2] - poses[k, :2]).T)
        near = np.flatnonzero(distances < settings.distance)
        found = [place for run in _runs(near) if (place := self._best(run, k, distances)) is not None]
        return [i for _, i in sorted(found, reverse=True)[: settings.places]]

    def _best(self, run: Ints, k: int, distances: Array) -> tuple[float, int] | None:
        """The node of a run that saw most of what node k sees, after how uncertain it is where the run is from k.

        None if that is known well enough, or the node saw too little.
        """
        _, P = self._graph.relative(int(run[np.argmin(distances[run])]), k)
        if (np.sqrt(np.diagonal(P)) < _KNOWN).all():
            return None
        poses, margin = self._graph.poses, _MARGIN + 2 * float(np.sqrt(P[0, 0] + P[1, 1]))
        shares = [
            agreement(self._surfaces[i], self._surfaces[k], compose(inverse(poses[i]), poses[k]), margin)[0]
            for i in run
        ]
        enough = max(shares) >= self._settings.loops.overlap
        return (float(np.linalg.det(P)), int(run[np.argmax(shares)])) if enough else None

    def _match(self, i: int, k: int, mean: Array, P: Array) -> Loop | None:
        settings = self._settings.loops
        match = match_scans(self._surfaces[i], self._surfaces[k], mean, P + _FLOOR, self._settings.match)
        fits = match.inliers >= settings.inliers and match.conflicts <= settings.conflicts
        if not fits or squared_distance(match.pose, mean, match.covariance + P) > self._gate:
            return None
        return Loop(i, k, match.pose, match.covariance)

    def _agreeing(self, new: Loop) -> list[Loop]:
        """The new loop and waiting ones that all fit each other, if they are enough; they wait no more."""
        agreed = [new]
        for loop in self._waiting[-2::-1]:
            if all(self._fit(loop, other) for other in agreed):
                agreed.append(loop)
        if len(agreed) < self._settings.loops.support or len({loop.j for loop in agreed}) < 2:
            return []
        self._waiting = [loop for loop in self._waiting if not any(loop is other for other in agreed)]
        return agreed

    def _fit(self, a: Loop, b: Loop) -> bool:
        """True if going from a.i by way of a.j to b.j ends where going by way of b.i does."""
        one, P_one = chain((a.pose, a.covariance), self._graph.relative(a.j, b.j))
        two, P_two = chain(self._graph.relative(a.i, b.i), (b.pose, b.covariance))
        return squared_distance(one, two, P_one + P_two) < self._gate


def _runs(nodes: Ints) -> list[Ints]:
    """Successive numbers together."""
    return [run for run in np.split(nodes, np.flatnonzero(np.diff(nodes) > 1) + 1) if len(run)]
