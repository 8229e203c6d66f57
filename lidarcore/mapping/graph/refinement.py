"""The last word on a map: all keyframes at once, by every patch of surface that several of them saw.

A pose graph takes each match for a measurement of its own, though matches share scans: it cannot say what the map is
worth. Here each patch counts once, and how far patches scatter is measured: noise times a factor, and the unevenness
that all patches of one view of one place share.
"""

from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.geometry import (
    UncertainPose,
    compose,
    compose_jacobians,
    relative_jacobians,
    rotation,
    wrap,
)
from lidarcore.geometry.kernels import relative_with_covariance
from lidarcore.mapping.graph.adjustment import Surfaces, normal_equations, speeds_left
from lidarcore.mapping.graph.cell_lines import Noise, Observations
from lidarcore.mapping.graph.equations import Step
from lidarcore.mapping.graph.factor import Factor
from lidarcore.mapping.graph.known import Known
from lidarcore.mapping.graph.recovery import Recovery
from lidarcore.mapping.graph.surface_noise import UNMEASURED, is_alike, measured
from lidarcore.mapping.matching.patches import Patches

_SETTLED = 0.01  # mean square of a step, in variances of the poses, below which it changes nothing
_MEASURED = 4  # rounds after which noise is known so well that steps can be compared


@dataclass(slots=True, eq=False)
class Refined:
    """Poses (K, 3) with their joint covariance; and what was measured of the surfaces.

    sweeps  (K, 3, 3) covariance that each pose has besides, seen from itself: of where its scan stands
    speeds  (K, 2, 3) m/s, m/s, rad/s that the sensor moved faster than was taken out of each scan, with variances
    joined  (K - 1,) whether surfaces tie a keyframe to the next one; else only the step between them does
    noise   of the patches, as it was measured
    """

    poses: Array
    sweeps: Array
    speeds: Array
    joined: Bools
    noise: Noise
    _recovery: Recovery

    def covariances(self) -> Array:
        """(K, 3, 3) of the poses as seen from the first: where that scan stands counts in all of them."""
        P = self.hung(np.arange(len(self.poses)), np.zeros(self.poses.shape), self.sweeps)
        P[0] = 0.0
        return P

    def hung(self, nodes: Ints, ties: Array, own: Array) -> Array:
        """(T, 3, 3) of poses that hang on keyframes as seen from the first.

        nodes (T,) are the keyframes, ties (T, 3) the poses seen from these, and own (T, 3, 3) the covariances that the
        poses, seen from themselves, have beside what they share with their keyframes.
        """
        at = compose(self.poses[nodes], ties)
        J, _ = compose_jacobians(self.poses[nodes], ties)
        shared = J @ self._recovery.diagonal()[nodes] @ J.swapaxes(1, 2)
        A, B = relative_jacobians(self.poses[:1], at)
        first = A @ turned(self.sweeps[0], self.poses[0, 2]) @ A.swapaxes(1, 2)
        # The first pose is fixed: the others share nothing with it but where its scan stands.
        P: Array = first + B @ (shared + turned(own, at[:, 2])) @ B.swapaxes(1, 2)
        return P

    @property
    def factor(self) -> Factor:
        """Of the information of the poses."""
        return self._recovery.factor

    def placed(self, i: int, j: int) -> UncertainPose:
        """T_i_j with its covariance, as if scans stood where they were placed."""
        return self._recovery.relative(i, j, self.poses)

    def relative(self, i: int, j: int) -> UncertainPose:
        """T_i_j with its covariance."""
        pose, P = self.placed(i, j)
        own_i, own_j = (turned(self.sweeps[k], self.poses[k, 2]) for k in (i, j))
        _, apart = relative_with_covariance(self.poses[i], self.poses[j], own_i, np.zeros((3, 3)), own_j)
        return UncertainPose(pose, P + apart)


def refine(
    scans: list[Patches],
    poses: Array,
    steps: list[Step],
    size: float,
    islands: Ints | None = None,
    sweeps: Array | None = None,
    since: list[Array] | None = None,
    assumed: float = 0.0,
    known: Known | None = None,
    before: "Refined | None" = None,
    rounds: int = 12,
) -> Refined:
    """Adjust poses (K, 3) that are right to about a cell's `size` m; the first one stays.

    islands (K,) number what each pose is right to: surfaces seen from different islands are different ones.
    sweeps (K, 3, 3) are covariances of where each scan stands beside its pose; they move nothing.
    since are times (N,) s from the mean time of each scan's beams until its patches were seen; None: all at once.
    assumed m is the unevenness that the patches' variances contain: it is measured here, and would count twice.
    known tells which parts of the way may be taken to have seen the same surfaces; None: all.
    before is what they were adjusted to last, which tells the noise and is near where they go now; None: never yet.
    steps tie keyframes by what is known where surfaces say nothing: by odometry or the going on of the motion, and by
    what was seen as well between keyframes that `known` does not join.
    """
    islands = np.zeros(len(poses), np.int64) if islands is None else islands
    sweeps = np.zeros((len(poses), 3, 3)) if sweeps is None else sweeps
    surfaces = Surfaces(_observations(scans, since, assumed**2), islands, size, known)
    noise, near = (before.noise, before.factor) if before else (UNMEASURED, None)
    poses, size_before = poses.copy(), np.inf
    for number in range(rounds):
        equations, groups = normal_equations(surfaces, poses, noise)
        equations = equations.with_steps(poses, steps)
        step, near = equations.solution(near)
        poses = poses + step.reshape(-1, 3)
        poses[:, 2] = wrap(poses[:, 2])
        taken, noise = noise, measured(groups, len(poses))
        size = float(-equations.gradient @ step) / len(step)
        if size < _SETTLED and is_alike(taken, noise, groups):
            break
        # Cells are cut anew in each round, which alone moves poses of a large building by some tenths of a deviation.
        if number >= _MEASURED and size >= size_before:
            break
        size_before = size
    del near  # two factors at once would take most of the memory
    speeds = speeds_left(surfaces, poses, noise)
    equations, _ = normal_equations(surfaces, poses, noise)
    recovery = Recovery(equations.with_steps(poses, steps).factored())
    return Refined(poses, sweeps, speeds, _joined(known, len(poses)), noise, recovery)


def _joined(known: Known | None, keyframes: int) -> Bools:
    """As said of Refined."""
    if known is None:
        return np.ones(max(keyframes - 1, 0), np.bool_)
    found: Bools = known.pairs[known.part[:-1], known.part[1:]]
    return found


def _observations(scans: list[Patches], since: list[Array] | None, assumed: float) -> Observations:
    """All patches, with the variance of noise alone: that of unevenness, m², is taken out."""
    numbers = np.repeat(np.arange(len(scans)), [len(scan.means) for scan in scans])
    columns = zip(
        *((scan.means, scan.normals, scan.variances - assumed, scan.counts > 0) for scan in scans),
        strict=True,
    )
    times = np.zeros(len(numbers)) if since is None else np.concatenate(since)
    means, normals, variances, near = (np.concatenate(column) for column in columns)
    return Observations(numbers, means, normals, variances, near, times)


def turned(covariances: Array, headings: Array) -> Array:
    """Covariances (..., 3, 3) of poses, seen from poses with these headings (...,) themselves, in the map."""
    R = np.zeros(covariances.shape)
    R[..., :2, :2], R[..., 2, 2] = rotation(headings), 1.0
    seen: Array = R @ covariances @ R.swapaxes(-1, -2)
    return seen
