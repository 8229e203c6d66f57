"""The line of a wall: all its segments in one estimate, and how it moves with the keyframes' poses.

A segment's line is the sufficient statistic of its points: adding the information of segments is fitting all points.
"""

from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import left_of, unit_vectors, wrap
from lidarcore.mapping.walls.pieces import Pieces

_SCATTER = 0.01
"""m: how far the points of one segment lie beside the wall together, by the keyframe's pose and the wall's unevenness.

It shares out weights between segments, so that a dense one does not decide alone, and is no part of what is claimed.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A line through a centre (2,) m with a normal of direction alpha rad, seen from the side the normal comes from.

    noise  (2, 2) of the angle and of the distance along the normal at the centre: by the sensor's noise alone
    gain   (N, 2, 3) how both follow the poses of the N segments' keyframes
    """

    centre: Array
    alpha: float
    noise: Array
    gain: Array

    @property
    def normal(self) -> Array:
        """(2,) unit vector across the line, away from who sees it."""
        return unit_vectors(self.alpha)

    @property
    def along(self) -> Array:
        """(2,) unit vector along the line, to the left of the normal."""
        return left_of(self.normal)

    def coordinates(self, xy: Array) -> tuple[Array, Array]:
        """Along the line from its centre, and beside it along the normal, of points (..., 2): both (...,) m."""
        return (xy - self.centre) @ self.along, (xy - self.centre) @ self.normal

    def point(self, t: float) -> Array:
        """(2,) m at a coordinate along the line."""
        return self.centre + t * self.along


def fit_line(pieces: Pieces, members: Ints) -> Fit:
    """The most likely line of the segments of one wall."""
    ends, points = pieces.ends[members], pieces.points[members]
    centre = np.average(ends.mean(axis=1), axis=0, weights=points)
    alpha = float(pieces.alpha[members[np.argmax(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1))]])
    angle, offset, from_line, from_pose = _measurements(pieces, members, centre, alpha)
    noise = from_line @ pieces.covariance[members] @ from_line.swapaxes(1, 2)
    weights = np.linalg.inv(noise + _scatter(ends, centre, alpha))
    spread = np.linalg.inv(weights.sum(axis=0))
    gains = spread @ weights
    turn, shift = (gains @ np.stack([angle, offset], -1)[..., None]).sum(axis=0)[:, 0]
    total = (gains @ noise @ gains.swapaxes(1, 2)).sum(axis=0)
    moved = centre + shift * unit_vectors(alpha)
    return Fit(moved, float(wrap(alpha + turn)), total, gains @ from_pose)


def _scatter(ends: Array, centre: Array, alpha: float) -> Array:
    """Covariances (N, 2, 2) of angle and offset at a centre, of segments shifted and turned by the scatter."""
    length = np.maximum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1), 1e-3)
    lever = (ends.mean(axis=1) - centre) @ left_of(unit_vectors(alpha))
    turn, shift = 12 * (_SCATTER / length) ** 2, np.full(len(ends), _SCATTER**2)
    mixed = lever * turn
    return np.stack([np.stack([turn, mixed], -1), np.stack([mixed, shift + lever * mixed], -1)], -2)


def _measurements(
    pieces: Pieces, members: Ints, centre: Array, alpha: float
) -> tuple[Array, Array, Array, Array]:
    """What each segment says of the line through a centre: angle and offset (N,), and their Jacobians.

    By the segment's line (N, 2, 2) and by its keyframe's pose (N, 2, 3), x, y and heading.
    """
    own = pieces.alpha[members]
    normal = unit_vectors(own)
    angle = wrap(own - alpha)
    offset = ((pieces.ends[members].mean(axis=1) - centre) * normal).sum(axis=-1)
    lever = ((pieces.position[members] - centre) * left_of(normal)).sum(axis=-1)
    one, zero = np.ones(len(members)), np.zeros(len(members))
    from_line = np.stack([np.stack([one, zero], -1), np.stack([lever, one], -1)], 1)
    from_pose = np.stack([np.stack([zero, zero, one], -1), np.stack([*normal.T, lever], -1)], 1)
    return angle, offset, from_line, from_pose
