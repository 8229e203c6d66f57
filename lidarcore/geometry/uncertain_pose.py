"""Poses with covariances, and how errors travel along with them, to first order."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array
from lidarcore.errors import CovarianceError
from lidarcore.geometry.gaussian import check_covariance
from lidarcore.geometry.kernels import compose_with_covariance, relative_with_covariance
from lidarcore.geometry.se2 import (
    compose,
    compose_jacobians,
    pose_difference,
    relative,
    relative_jacobians,
    wrap,
)

_INDEPENDENT = np.zeros((3, 3))
_WEIGHTS = np.linspace(0.0, 1.0, 101)[:, None, None]


class UncertainPose(NamedTuple):
    """T_a_b (..., 3) and the covariance (..., 3, 3) of its coordinates x, y, heading."""

    pose: Array
    covariance: Array

    def compose(self, T_b_c: "UncertainPose") -> "UncertainPose":
        """T_a_c, the errors of both poses being independent."""
        if self.pose.ndim == T_b_c.pose.ndim == 1:
            return UncertainPose(*compose_with_covariance(*_own(self), *_own(T_b_c)))
        F, G = compose_jacobians(self.pose, T_b_c.pose)
        covariance = _carried(F, self.covariance) + _carried(G, T_b_c.covariance)
        return UncertainPose(compose(self.pose, T_b_c.pose), covariance)

    def intersect(self, other: "UncertainPose") -> "UncertainPose":
        """One estimate from two of the same pose, however their errors depend on each other.

        Covariance intersection [Julier and Uhlmann 1997] with the weight of the least determinant.
        """
        A, B = np.linalg.inv(self.covariance), np.linalg.inv(other.covariance)
        sums = _WEIGHTS * A + (1 - _WEIGHTS) * B
        best = int(np.argmax(np.linalg.slogdet(sums)[1]))
        covariance, weight = np.linalg.inv(sums[best]), float(_WEIGHTS[best, 0, 0])
        pose = self.pose + (1 - weight) * covariance @ B @ pose_difference(other.pose, self.pose)
        return UncertainPose(np.array([*pose[:2], wrap(pose[2])]), (covariance + covariance.T) / 2)

    def relative(self, T_a_c: "UncertainPose") -> "UncertainPose":
        """T_b_c of poses in one frame with independent errors."""
        if self.pose.ndim == T_a_c.pose.ndim == 1:
            (pose, own), (seen, other) = _own(self), _own(T_a_c)
            return UncertainPose(*relative_with_covariance(pose, seen, own, _INDEPENDENT, other))
        A, B = relative_jacobians(self.pose, T_a_c.pose)
        covariance = _carried(A, self.covariance) + _carried(B, T_a_c.covariance)
        return UncertainPose(relative(self.pose, T_a_c.pose), covariance)


HERE = UncertainPose(np.zeros(3), np.zeros((3, 3)))
"""Where a frame is, seen from itself."""


def as_pose_covariance(values: ArrayLike, name: str) -> Array:
    """The covariance (3, 3) of a pose. Raises CovarianceError if it is none."""
    P = np.array(values, np.float64)
    if P.shape != (3, 3):
        raise CovarianceError(f"{name} has shape {P.shape}: give that of x, y and heading, (3, 3).")
    check_covariance(P, name)
    return P


def _own(pose: UncertainPose) -> tuple[Array, Array]:
    """Copies for a kernel, which is compiled anew for arrays that are read-only or not contiguous."""
    return np.array(pose.pose, np.float64), np.array(pose.covariance, np.float64)


def _carried(J: Array, covariance: Array) -> Array:
    return J @ covariance @ np.swapaxes(J, -1, -2)
