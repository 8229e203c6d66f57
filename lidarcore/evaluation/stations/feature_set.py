"""What one scan says of walls and corners, ready to be compared with what another says from elsewhere."""

from dataclasses import dataclass, replace

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.features import Features
from lidarcore.geometry import left_of, unit_vectors


@dataclass(frozen=True, slots=True, eq=False)
class FeatureSet:
    """M walls and K corners, sensor frame.

    lines (M, 2) alpha rad, r m; ends (M, 2, 2) m; covariances (M, 2, 2) of the lines; corners (K, 2) m with
    corner_covariances (K, 2, 2) m² and the numbers of their walls (K, 2).
    """

    lines: Array
    ends: Array
    covariances: Array
    corners: Array
    corner_covariances: Array
    walls: Ints

    @classmethod
    def of(cls, found: Features) -> "FeatureSet":
        """What was found, with the covariances that the settings asked for."""
        segments, lines, corners = found.segments, found.lines, found.corners
        return cls(
            np.column_stack([lines.alpha, lines.r]),
            np.stack([segments.start, segments.end], 1),
            lines.covariance,
            corners.xy,
            corners.covariance,
            corners.segments,
        )

    def with_systematic(self, sigma: float) -> "FeatureSet":
        """These features with a systematic part, the same in every scan from one place, in walls and so in corners.

        The wall as a whole is off by sigma m, and its ends against each other by twice that.
        """
        if not sigma:
            return self
        added = sigma**2 * self._unit_systematic()
        corner_covariances = self.corner_covariances + self._of_corners(added)
        return replace(self, covariances=self.covariances + added, corner_covariances=corner_covariances)

    def _unit_systematic(self) -> Array:
        """(M, 2, 2) of alpha and r, for a sigma of 1 m."""
        along = (self.ends * left_of(unit_vectors(self.lines[:, 0]))[:, None]).sum(-1)
        middle, half = along.mean(1), np.maximum(np.ptp(along, axis=1) / 2, 1e-3)
        a_a = 1 / half**2
        a_r = middle * a_a
        r_r = 1 + middle * a_r
        return np.stack([a_a, a_r, a_r, r_r], -1).reshape(-1, 2, 2)

    def _of_corners(self, added: Array) -> Array:
        """(K, 2, 2) m² that covariances (M, 2, 2) of the lines make of corners: n . x = r for both lines."""
        normals = unit_vectors(self.lines[self.walls, 0])  # (K, 2, 2)
        along = (left_of(normals) * self.corners[:, None]).sum(-1)
        slope = np.stack([-along, np.ones_like(along)], -1)  # of n . x - r, by alpha and r, negative
        across = np.einsum("kwi,kwij,kwj->kw", slope, added[self.walls], slope)
        inverse = np.linalg.inv(normals)
        return np.einsum("kiw,kw,kjw->kij", inverse, across, inverse)


def moved(lines: Array, pose: Array) -> tuple[Array, Array, Array]:
    """Lines (M, 2) of frame b in frame a, T_a_b (3,); Jacobians (M, 2, 3) by the pose and (M, 2, 2) by the lines."""
    alpha = lines[:, 0] + pose[2]
    normal = unit_vectors(alpha)
    turned = left_of(normal) @ pose[:2]
    by_pose, by_line = np.zeros((len(lines), 2, 3)), np.zeros((len(lines), 2, 2))
    by_pose[:, 0, 2] = 1
    by_pose[:, 1, :2], by_pose[:, 1, 2] = normal, turned
    by_line[:, 0, 0] = by_line[:, 1, 1] = 1
    by_line[:, 1, 0] = turned
    return np.column_stack([alpha, lines[:, 1] + normal @ pose[:2]]), by_pose, by_line
