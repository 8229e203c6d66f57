"""Where a node may be, seen from an earlier one: what was seen around both is registered on each other."""

from itertools import islice

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import HERE, UncertainPose, chi_square_gate, compose, relative, wrap
from lidarcore.mapping.graph.known import JointPoses
from lidarcore.mapping.loops.consistency import Loop, spread, squared
from lidarcore.mapping.loops.keyframes import Keyframe
from lidarcore.mapping.loops.passes import Passes
from lidarcore.mapping.matching.correlative import candidates
from lidarcore.mapping.matching.patches import Patches
from lidarcore.mapping.matching.registration import information_of, register
from lidarcore.mapping.matching.sight import conflicts
from lidarcore.mapping.matching.surfels import Surfels, surfels
from lidarcore.mapping.settings import LoopSettings, MatchSettings

CAUTION = 4.0
"""A single wrong loop makes the graph surer than it should be: loops are looked for as if it were less sure."""
# The guess takes part with this many times its covariance, lest it is counted twice in the graph.
_WIDEN = 9.0
# A guess from the graph is never taken to be better than this: the search has to move.
_FLOOR = np.diag([0.05, 0.05, 0.02]) ** 2
_RIVAL = 0.85  # of the best match's quality, from which on another place is a rival
_SIGMAS = 3  # to either side, up to which places of a pass are sought
_APART = 0.5  # m at least between two places of a pass
_PLACES = 6  # of a pass, at most, that one node is matched with


class Hypotheses:
    """Of nodes of a graph, at earlier ones that its passes tell."""

    def __init__(
        self,
        graph: JointPoses,
        keyframes: dict[int, Keyframe],
        passes: Passes,
        loops: LoopSettings,
        match: MatchSettings,
    ) -> None:
        self._graph, self._keyframes, self._passes = graph, keyframes, passes
        self._settings, self._match = loops, match
        self._gate = float(chi_square_gate(loops.gate, 3))

    def at(self, i: int, k: int, P: Array, seen: Patches, gated: bool = True) -> list[Loop]:
        """Where node k may be, on the pass of node i: the best place, and its rivals if they are nearly as good.

        P (3, 3) is the covariance of node k seen from node i, `seen` what was seen around it. No place may be where
        the graph does not expect it, if `gated`.
        """
        cautious, is_vague = _cautious(P), self._passes.is_vague(P)
        far = _SIGMAS * spread(cautious)
        nodes = self._passes.around(i, k, far)
        found: list[Loop] = []
        for start in self._starts(i, k, cautious, nodes, seen, 1 + int(far / _APART) if is_vague else 1):
            place = compose(self._graph.poses[i], start)
            n = self._passes.best_at(nodes if is_vague else np.array([i]), k, place)
            loop = None if n is None else self._tied(n, k, place, seen, gated)
            if loop is not None and not any(self._is_same(loop, other) for other in found):
                found.append(loop)
        best = max((loop.quality for loop in found), default=0.0)
        return [loop for loop in found if loop.quality >= _RIVAL * best]

    def _starts(self, i: int, k: int, P: Array, nodes: Ints, seen: Patches, room: int) -> Array:
        """Up to `room` T_i_k (S, 3) within P (3, 3) at which what was seen fits the nodes of a pass, best first.

        The whole pass is searched at once: on a part of it, what was seen overlaps most where the graph expects it,
        and in a corridor whose doors are all alike that place would always win.
        """
        reference = self._passes.seen(i, nodes).means
        mean, sigma = relative(self._graph.poses[i], self._graph.poses[k]), np.sqrt(np.diagonal(P))
        found = candidates(reference, seen.means, mean, sigma, self._match)
        return np.array(list(islice(found, min(room, _PLACES))))

    def _tied(self, i: int, k: int, place: Array, seen: Patches, gated: bool) -> Loop | None:
        """Node k, taken to be at a place (3,), registered on what was seen around node i; None if it does not fit."""
        mean, P = self._graph.relative(i, k)
        match, start = self._match, relative(self._graph.poses[i], place)
        around = self._passes.seen(i, self._passes.around(i, k, 0.0))
        reference = surfels(around, match.patch, match.reach)
        start[2] = mean[2] + wrap(start[2] - mean[2])
        prior = information_of(_WIDEN * _cautious(P))
        registered = register(reference, seen, start, mean, prior, match.reach)
        if registered.inliers < self._settings.inliers:
            return None
        C = information_of(registered.information) + self._settings.floor
        if gated and squared(registered.pose, mean, C + _cautious(P)) > self._gate:
            return None
        earlier, now = self._keyframes[i], self._keyframes[k]
        against = conflicts(earlier.sight, now.sight, registered.pose)
        if against > self._settings.conflicts:
            return None
        alone = self._alone(k, UncertainPose(registered.pose, C), reference)
        return Loop(i, k, *_between_sensors(alone, earlier, now), registered.inliers - against)

    def _alone(self, k: int, together: UncertainPose, reference: Surfels) -> UncertainPose:
        """T_i_k as the scan of node k alone says, from where it and the scans before it lie together (T_i_k, too).

        It was tied to these by steps that may be off, and stands off from what they saw by as much.
        """
        guess, C = together.compose(self._astray(k))
        seen = self._keyframes[k].patches.near
        registered = register(
            reference, seen, guess, guess, information_of(C), self._match.reach, settled=True
        )
        return UncertainPose(registered.pose, information_of(registered.information) + self._settings.floor)

    def _astray(self, k: int) -> UncertainPose:
        """How far node k may stand off from where the graph has it, seen from a few nodes before; the pose is 0."""
        pose, P = self._graph.relative(max(0, k - self._settings.before), k)
        return UncertainPose(pose, np.zeros((3, 3))).relative(UncertainPose(pose, P))

    def _is_same(self, a: Loop, b: Loop) -> bool:
        """True if two places are one, known only vaguely (along a corridor)."""
        poses = self._graph.poses
        apart = UncertainPose(relative(poses[a.i], poses[b.i]), np.zeros((3, 3)))
        pose, P = apart.compose(UncertainPose(b.pose, b.covariance))
        return squared(a.pose, pose, a.covariance + P) < self._gate


def _between_sensors(scans: UncertainPose, earlier: Keyframe, later: Keyframe) -> UncertainPose:
    """T_i_k of two keyframes whose scans lie so: where the sensors were at their stamps is less sure than that."""
    begin, end = (HERE._replace(covariance=keyframe.sweep) for keyframe in (earlier, later))
    return begin.relative(scans.compose(end))


def _cautious(P: Array) -> Array:
    """What is taken for the covariance (3, 3) of a pose that the graph knows within P."""
    return CAUTION * P + _FLOOR
