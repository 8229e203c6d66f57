"""Which loops support each other: ties that two passes of a place have in common [Mangelson et al., ICRA 2018]."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import kernel
from lidarcore.geometry import HERE, UncertainPose, kernels, pose_difference, squared_mahalanobis
from lidarcore.mapping.graph.known import JointPoses

# Share of the spread with which a loop was expected, up to which the way around tells whether it is true.
_TELLING = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """T_i_j (3,) with its covariance (3, 3), of an earlier node i and a later node j.

    quality  share of the later submap that lies on the earlier one, less what contradicts it
    """

    i: int
    j: int
    pose: Array
    covariance: Array
    quality: float


class Consistency:
    """Which loops agree with each other, by what a graph says between two of its changes."""

    def __init__(self, graph: JointPoses, gate: float) -> None:
        """`gate` is the largest squared Mahalanobis distance of two ways that end at one place."""
        self._relative, self._gate = cache(graph.relative), gate
        self._known: dict[tuple[Loop, Loop], bool] = {}

    def agree(self, a: Loop, b: Loop) -> bool:
        """True if going from a.i by way of a.j to b.j ends where going by way of b.i does, and not just anywhere.

        Where the way around is known little better than the graph expects the loops, any two would fit: a loop within
        one pass says nothing about a tie to another one.
        """
        if (a, b) not in self._known:
            self._known[a, b] = self._agree(a, b)
        return self._known[a, b]

    def _agree(self, a: Loop, b: Loop) -> bool:
        later, earlier = self._way(a.j, b.j), self._way(a.i, b.i)
        distance, known = _compared(a.pose, a.covariance, *later, *earlier, b.pose, b.covariance)
        if not distance < self._gate:
            return False
        return known < _TELLING * min(spread(self._way(loop.i, loop.j).covariance) for loop in (a, b))

    def agreeing(self, loop: Loop, others: Sequence[Loop]) -> list[Loop]:
        """The loop, and others that all agree with each other, the last ones first."""
        found = [loop]
        for other in others[::-1]:
            if other is not loop and all(self.agree(other, member) for member in found):
                found.append(other)
        return found

    def _way(self, i: int, j: int) -> UncertainPose:
        return HERE if i == j else self._relative(i, j)


def support(loops: Sequence[Loop]) -> float:
    """Sum of the best quality at each node."""
    best: dict[int, float] = {}
    for loop in loops:
        best[loop.j] = max(best.get(loop.j, 0.0), loop.quality)
    return sum(best.values())


def spread(P: Array) -> float:
    """Standard deviation in m of a place with covariance (3, 3)."""
    return float(np.sqrt(max(P[0, 0] + P[1, 1], 0.0)))


def squared(a: Array, b: Array, P: Array) -> float:
    """Squared Mahalanobis distance of two poses (3,)."""
    return float(squared_mahalanobis(pose_difference(a, b), P))


@kernel
def _compared(
    a: Array, P: Array, later: Array, Q: Array, earlier: Array, R: Array, b: Array, S: Array
) -> tuple[float, float]:
    """Squared Mahalanobis distance of a and then `later` from `earlier` and then b, and its standard deviation, m."""
    one, ahead = kernels.compose_with_covariance(a, P, later, Q)
    two, behind = kernels.compose_with_covariance(earlier, R, b, S)
    difference, both = one - two, ahead + behind
    difference[2] = kernels.wrap(difference[2])
    return kernels.squared_mahalanobis(difference, both), np.sqrt(max(both[0, 0] + both[1, 1], 0.0))
