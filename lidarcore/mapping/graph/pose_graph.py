"""A pose graph: poses tied by relative poses with covariances, in information form [Lu & Milios 1997].

The information of all poses is sparse, with one block for each edge [Eustice et al. 2006]. Gauss-Newton solves it with
a sparse factor [Kümmerle et al. 2011], and the covariances that are asked for come from the same factor. Edges that
may be wrong are scaled down by how much they disagree [Agarwal et al. 2013], new ones step by step [Yang et al. 2020].
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array, csc_array
from scipy.sparse.csgraph import connected_components

from lidarcore.arrays import Array, Ints
from lidarcore.errors import LocalizationError
from lidarcore.geometry import UncertainPose, as_pose_covariance, relative_jacobians, wrap
from lidarcore.localization.ekf.estimate import as_pose
from lidarcore.mapping.doubt import DOUBTFUL, loss
from lidarcore.mapping.graph.edges import edge_errors, linearise
from lidarcore.mapping.graph.factor import Factor
from lidarcore.mapping.graph.recovery import Recovery

_COOLING = 4.0  # by which doubts about new edges set in earlier from round to round
FIXED = 1e12  # information of the first pose
_HALVINGS = 12  # of a step that makes poses less likely
_ROUNDING = 1e-9  # of what optimization makes smallest


class PoseGraph:
    """Poses T_world_node of nodes 0, 1, ..., the first of which is fixed."""

    def __init__(self, first: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        self._poses = as_pose(first, "The first pose")[None]
        self._ends = np.empty((0, 2), np.int64)
        self._relatives = np.empty((0, 3))
        self._informations = np.empty((0, 3, 3))
        self._doubts = np.empty(0)
        self._settled = 0  # number of edges that took part in the last optimization
        self._recovery: Recovery | None = None

    def __len__(self) -> int:
        return len(self._poses)

    @property
    def poses(self) -> Array:
        """(N, 3) m, m, rad."""
        return self._poses.copy()

    @property
    def edges(self) -> Ints:
        """(E, 2) from and to."""
        return self._ends.copy()

    @property
    def chi_square(self) -> Array:
        """(E,) squared Mahalanobis distance of each edge from the poses: three degrees of freedom each."""
        return edge_errors(self._poses, self._ends, self._relatives, self._informations)

    def add(self, pose: ArrayLike) -> int:
        """Append a node at a pose (3,), T_world_node as far as is known. Returns its number."""
        self._poses = np.concatenate([self._poses, as_pose(pose, "The pose")[None]])
        return len(self) - 1

    def move(self, poses: Array) -> None:
        """Put the nodes at poses (N, 3), where something that knows more than the edges has them."""
        self._poses = np.array(poses, np.float64)
        self._recovery = None

    def connect(
        self, i: int, j: int, relative: ArrayLike, covariance: ArrayLike, doubted: bool = False
    ) -> int:
        """Tie node j to node i by T_i_j (3,) with its covariance (3, 3); a doubted edge loses weight if it disagrees.

        Returns the number of the edge.

        Raises LocalizationError if a node is unknown or the pose not finite, CovarianceError if the covariance is not
        positive definite.
        """
        if i == j or not (0 <= i < len(self) and 0 <= j < len(self)):
            raise LocalizationError(f"There is no edge from node {i} to {j} in a graph of {len(self)} nodes.")
        z = as_pose(relative, "The relative pose")
        P = as_pose_covariance(covariance, "The covariance of the relative pose")
        information = np.linalg.inv(P)
        self._ends = np.concatenate([self._ends, [[i, j]]])
        self._relatives = np.concatenate([self._relatives, z[None]])
        self._informations = np.concatenate([self._informations, information[None]])
        self._doubts = np.append(self._doubts, DOUBTFUL if doubted else np.inf)
        self._recovery = self._extended(i, j, P, doubted)
        return len(self._ends) - 1

    def edge(self, number: int) -> UncertainPose:
        """T_i_j (3,) as an edge has it, and its covariance (3, 3)."""
        return UncertainPose(self._relatives[number].copy(), np.linalg.inv(self._informations[number]))

    def amend(self, edge: int, change: Array) -> None:
        """Change (3,) the relative pose of an edge, which is known as well as before."""
        self._relatives[edge] += change
        self._recovery = None

    def optimize(self, tolerance: float = 1e-6, rounds: int = 50) -> float:
        """Move the nodes to the most likely poses.

        Gauss-Newton until no pose moves by more than the tolerance (m, rad). Returns chi-square of all edges,
        doubted ones as far as they count.
        Raises LocalizationError if a node is not connected to node 0; the poses are untouched then.
        """
        self._check_connected()
        poses, heat, chi2 = self._poses.copy(), self._heat(), 0.0
        for _ in range(rounds):
            H, b, chi2 = self._linearised(poses, heat)
            solver = Factor(H)
            whole = solver.solve(-b).reshape(-1, 3)
            whole[0] = 0.0
            step = self._shortened(whole, poses, heat)
            poses = _moved(poses, step)
            if heat == 1 and (np.abs(whole).max() < tolerance or not step.any()):
                break
            heat = max(1.0, heat / _COOLING)
        self._poses, self._recovery, self._settled = poses, Recovery(solver), len(self._ends)
        return chi2

    def _shortened(self, step: Array, poses: Array, heat: float) -> Array:
        """A step (N, 3), or so much of it that poses do not become less likely; none of it if any does that.

        Where the heading of many nodes is open, as that of an island is, a whole step may lead to other ends.
        """
        before = self._cost(poses, heat)
        for _ in range(_HALVINGS):
            if self._cost(_moved(poses, step), heat) <= before + _ROUNDING * (1 + before):
                return step
            step = step / 2
        return np.zeros(step.shape)

    def _cost(self, poses: Array, heat: float) -> float:
        """What optimization makes smallest: chi-square, less where doubts begin."""
        chi2 = edge_errors(poses, self._ends, self._relatives, self._informations)
        return float(loss(chi2, heat * self._doubts).sum())

    def covariance(self, i: int) -> Array:
        """Covariance (3, 3) of the pose of node i, given node 0."""
        P: Array = self._recovered.block(i, i)
        return (P + P.T) / 2  # without the rounding of a sparse solution

    def relative(self, i: int, j: int) -> UncertainPose:
        """T_i_j (3,) as the graph has it now, and its covariance (3, 3)."""
        return self._recovered.relative(i, j, self._poses)

    def covariances(self) -> Array:
        """(N, 3, 3): covariance of the pose of each node, given node 0."""
        return self._recovered.diagonal()

    @property
    def _recovered(self) -> Recovery:
        if self._recovery is None or len(self._recovery) < len(self):
            self._check_connected()
            self._recovery = Recovery(Factor(self._linearised(self._poses, 1.0)[0]))
        return self._recovery

    def _extended(self, i: int, j: int, P: Array, doubted: bool) -> Recovery | None:
        """What stays known of covariances if an edge with covariance P ties the newest node to the one before."""
        known = self._recovery
        if known is None or doubted or not i + 1 == j == len(known):
            return None
        A, B = relative_jacobians(self._poses[i], self._poses[j])
        back = np.linalg.inv(B)
        known.append(-back @ A, back @ P @ back.T)
        return known

    def _check_connected(self) -> None:
        ones = np.ones(len(self._ends), np.int8)
        edges = coo_array((ones, tuple(self._ends.T)), shape=(len(self), len(self)))
        parts, part = connected_components(edges, directed=False)
        if parts > 1:
            loose = int(np.flatnonzero(part != part[0])[0])
            raise LocalizationError(
                f"No path of edges leads from node 0 to node {loose}: connect every node first."
            )

    def _heat(self) -> float:
        """How much later than usual doubts about new edges must begin for all of them to count.

        A true loop that bends a stiff graph disagrees with it at first; doubted at once, it would never bend it.
        """
        new = slice(self._settled, None)
        return max(1.0, float((self.chi_square[new] / self._doubts[new]).max(initial=0)))

    def _linearised(self, poses: Array, heat: float) -> tuple[csc_array, Array, float]:
        """Information matrix H (3 N, 3 N), gradient b (3 N,) and chi-square at the poses, the first one fixed."""
        blocks, b = np.empty((len(self._ends), 6, 6)), np.zeros(3 * len(poses))
        doubts = heat * self._doubts
        chi2 = linearise(poses, self._ends, self._relatives, self._informations, doubts, blocks, b)
        index = (3 * self._ends[:, :, None] + np.arange(3)).reshape(-1, 6)
        row, column = np.broadcast_arrays(index[:, :, None], index[:, None, :])
        entries = np.append(blocks.ravel(), [FIXED] * 3)
        places = np.append(row.ravel(), [0, 1, 2]), np.append(column.ravel(), [0, 1, 2])
        return csc_array((entries, places), shape=(len(b), len(b))), b, chi2


def _moved(poses: Array, step: Array) -> Array:
    """Poses (N, 3) after a step (N, 3)."""
    after = poses + step
    after[:, 2] = wrap(after[:, 2])
    return after
