"""Poses of the plane and 2D Gaussians on arrays, any number at once.

A pose is an array (..., 3): x m, y m, heading rad in (-pi, pi]. T_a_b is the pose of frame b in frame a; it takes
coordinates in b to coordinates in a.
"""

from lidarcore.geometry.gaussian import (
    check_covariance,
    chi_square_gate,
    contains,
    ellipse_axes,
    ellipse_outline,
    fuse,
    largest_variance,
    rotated_covariance,
    squared_mahalanobis,
    squared_mahalanobis_2d,
)
from lidarcore.geometry.pose_track import PoseTrack
from lidarcore.geometry.se2 import (
    act,
    act_inverse,
    act_inverse_jacobians,
    act_jacobians,
    compose,
    compose_jacobians,
    inverse,
    left_of,
    pose_difference,
    relative,
    relative_jacobians,
    rotate,
    rotate_one,
    rotation,
    unit_vectors,
    wrap,
)
from lidarcore.geometry.uncertain_pose import HERE, UncertainPose, as_pose_covariance

__all__ = [
    "HERE",
    "PoseTrack",
    "UncertainPose",
    "act",
    "act_inverse",
    "act_inverse_jacobians",
    "act_jacobians",
    "as_pose_covariance",
    "check_covariance",
    "chi_square_gate",
    "compose",
    "compose_jacobians",
    "contains",
    "ellipse_axes",
    "ellipse_outline",
    "fuse",
    "inverse",
    "largest_variance",
    "left_of",
    "pose_difference",
    "relative",
    "relative_jacobians",
    "rotate",
    "rotate_one",
    "rotated_covariance",
    "rotation",
    "squared_mahalanobis",
    "squared_mahalanobis_2d",
    "unit_vectors",
    "wrap",
]
