"""How each keyframe was reached from the one before it: by motion alone, and by what was seen as well."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import UncertainPose, pose_difference, squared_mahalanobis
from lidarcore.mapping.doubt import DOUBTFUL, trust
from lidarcore.mapping.graph.equations import Step
from lidarcore.mapping.graph.known import Known
from lidarcore.mapping.graph.pose_graph import PoseGraph
from lidarcore.mapping.matching.odometry_calibration import Taken
from lidarcore.mapping.tracked import Tracked


class _Driven(NamedTuple):
    """How a keyframe's edge hangs on odometry.

    taken  errors of odometry that were taken out, and their effects
    share  (3, 3) of the motion by odometry that is in the edge: nearly none where scans tell it
    """

    taken: Taken
    share: Array


class Steps:
    """Of all keyframes but the first, in the order of time. What was seen as well is an edge of the graph."""

    def __init__(self, graph: PoseGraph) -> None:
        self._graph = graph
        self._by_motion: list[Step] = []
        self._edges: list[int] = []  # of the graph
        self._driven: dict[int, _Driven] = {}  # by the number of the step

    def add(self, i: int, j: int, moved: UncertainPose, tie: UncertainPose) -> None:
        """From keyframe i to j: T_i_j by motion alone, which counts less if it contradicts what was seen, and by that.

        How much it counts stays: where surfaces say next to nothing, as in a bare corridor, their errors would carry a
        few scans away from what wheels say, and wheels would count the less the farther they went.
        """
        chi2 = squared_mahalanobis(pose_difference(tie.pose, moved.pose), moved.covariance)
        self._by_motion.append(Step(i, j, moved.pose, moved.covariance / trust(chi2, DOUBTFUL)))
        self._edges.append(self._graph.connect(i, j, *tie))

    def tell_of_wheels(self, tracked: Tracked) -> None:
        """Odometry took part in the last step, and some of its errors were taken out."""
        if tracked.wheels is not None:
            self._driven[len(self._edges) - 1] = _Driven(tracked.wheels, _share(tracked))

    def recalibrate(self, errors: Array) -> bool:
        """Take out what odometry does wrong (4,) at each, known less well on the way; whether there is any."""
        for number, driven in self._driven.items():
            step = self._by_motion[number]
            change = driven.taken.effects @ (errors - driven.taken.errors)
            self._by_motion[number] = replace(step, pose=step.pose + change)
            self._graph.amend(self._edges[number], driven.share @ change)
            self._driven[number] = driven._replace(taken=driven.taken._replace(errors=errors))
        return bool(self._driven)

    def besides(self, known: Known) -> list[Step]:
        """By motion alone where surfaces tell the rest; by what was seen where they need not be the same."""
        part = known.part
        return [
            step if known.pairs[part[step.i], part[step.j]] else Step(step.i, step.j, *self._graph.edge(edge))
            for step, edge in zip(self._by_motion, self._edges, strict=True)
        ]

    def covariances(self) -> Array:
        """(K - 1, 3, 3) of what was seen."""
        return np.reshape([self._graph.edge(edge).covariance for edge in self._edges], (-1, 3, 3))


def _share(tracked: Tracked) -> Array:
    """Derivative (3, 3) of a keyframe's tie for the motion by odometry that took part in it; 0 if wheels slipped."""
    moved = tracked.moved
    if squared_mahalanobis(pose_difference(tracked.tie.pose, moved.pose), moved.covariance) > DOUBTFUL:
        return np.zeros((3, 3))
    share: Array = (tracked.tie.covariance - tracked.sweep) @ np.linalg.inv(moved.covariance)
    return share
