"""Where the sensor is in a known map, from nothing: by constellations of landmarks, without a prior pose.

Two observed points and two landmarks equally far apart fix a pose; the pose that explains most of the scan wins
(pairwise geometric hashing with a consensus, as in Fischler and Bolles 1981), and it must win alone.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidarcore.errors import LostError
from lidarcore.localization.measurement import rotation, to_sensor
from lidarcore.localization.points import Points
from lidarcore.poses import wrap
from lidarcore.scan import Array, Ints

_SIGMAS = 4.0
_PAIRS = 12  # observed pairs to try, the longest ones: they fix the heading best
_SAME = np.array([0.3, 0.3, 0.2])  # m, m, rad: poses nearer than this are one
_ROUNDS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Relocation:
    """A pose found: T_world_sensor (3,) with covariance (3, 3), and its pairs (P, 2) of observation and landmark."""

    pose: Array
    covariance: Array
    pairs: Ints


def relocalize(observed: Points, landmarks: Points, min_pairs: int = 4) -> Relocation:
    """Find the one pose from which the landmarks of the map explain min_pairs of the points seen, and half of them.

    Raises LostError if there is none, or several explain as much: a symmetric room, or too few points.
    """
    found: list[Relocation] = []
    min_pairs = max(min_pairs, (len(observed) + 1) // 2)
    if min(len(observed), len(landmarks)) < min_pairs:
        raise _unexplained(min_pairs, observed)
    poses, tree = _hypotheses(observed, landmarks), cKDTree(landmarks.xy)
    counts = _counts(poses, observed, landmarks, tree)
    for pose in poses[np.argsort(-counts, kind="stable")[: np.sum(counts >= min_pairs)]]:
        if not any(_same(pose, known.pose) for known in found):
            candidate = _refine(pose, observed, landmarks, tree)
            if candidate and not any(_same(candidate.pose, known.pose) for known in found):
                found.append(candidate)
        if len(found) > 1 and len(found[-1].pairs) < len(found[0].pairs):
            break
    found.sort(key=lambda relocation: -len(relocation.pairs))
    if not found or len(found[0].pairs) < min_pairs:
        raise _unexplained(min_pairs, observed)
    if len(found) > 1 and len(found[1].pairs) == len(found[0].pairs):
        raise LostError(
            f"Several poses explain {len(found[0].pairs)} of the {len(observed)} points seen, such as "
            f"{found[0].pose.round(2)} and {found[1].pose.round(2)}: move on, or say where the sensor is."
        )
    return found[0]


def _hypotheses(observed: Points, landmarks: Points) -> Array:
    """Poses (H, 3) that bring two observed points onto two landmarks of their kinds."""
    spacing = np.linalg.norm(landmarks.xy[:, None] - landmarks.xy, axis=-1)
    lengths = np.linalg.norm(observed.xy[:, None] - observed.xy, axis=-1)
    i, j = np.triu_indices(len(observed), 1)
    kinds, known = np.asarray(observed.kinds), np.asarray(landmarks.kinds)
    poses = [np.empty((0, 3))]
    for pair in np.argsort(-lengths[i, j])[:_PAIRS]:
        first, second = i[pair], j[pair]
        spread = np.sqrt(np.trace(observed.covariance[first] + observed.covariance[second]))
        alike = np.abs(spacing - lengths[first, second]) < _SIGMAS * spread
        alike &= (known == kinds[first])[:, None] & (known == kinds[second])
        np.fill_diagonal(alike, False)
        a, b = np.nonzero(alike)
        poses.append(_onto(observed.xy[[first, second]], landmarks.xy[a], landmarks.xy[b]))
    return np.concatenate(poses)


def _onto(points: Array, start: Array, end: Array) -> Array:
    """Poses (H, 3) that bring the middle and direction of two points (2, 2) onto those of start and end (H, 2)."""
    z, m = points @ [1, 1j], np.stack([start, end]) @ [1, 1j]
    turn = np.angle((m[1] - m[0]) / (z[1] - z[0]))
    position = m.mean(axis=0) - np.exp(1j * turn) * z.mean()
    return np.stack([position.real, position.imag, turn], -1)


def _counts(poses: Array, observed: Points, landmarks: Points, tree: cKDTree) -> Ints:
    """About how many pairs (H,) each pose (H, 3) explains; a landmark may count twice."""
    z, turn = observed.xy @ [1, 1j], np.exp(1j * poses[:, 2:])
    placed = poses[:, :1] + 1j * poses[:, 1:2] + turn * z
    _, close = _nearest(np.stack([placed.real, placed.imag], -1), observed, landmarks, tree)
    counts: Ints = close.sum(axis=-1, dtype=np.int64)
    return counts


def _nearest(
    placed: Array, observed: Points, landmarks: Points, tree: cKDTree
) -> tuple[Ints, NDArray[np.bool_]]:
    """The nearest landmark (..., K) of points placed (..., K, 2) m in the world, and whether it is close enough."""
    distance, nearest = tree.query(placed)
    reach = np.sqrt(
        np.trace(observed.covariance, axis1=1, axis2=2)
        + np.trace(landmarks.covariance, axis1=1, axis2=2)[nearest]
    )
    # A hypothesis is as uncertain as the two points it rests on: twice the reach of the point itself.
    close = distance < 2 * _SIGMAS * reach
    close &= np.asarray(observed.kinds) == np.asarray(landmarks.kinds)[nearest]
    return nearest, close


def _pairs(pose: Array, observed: Points, landmarks: Points, tree: cKDTree) -> Ints:
    """(P, 2) one-to-one pairs of observations and landmarks that lie within each other's reach."""
    nearest, close = _nearest(pose[:2] + observed.xy @ rotation(pose[2]).T, observed, landmarks, tree)
    _, once = np.unique(nearest[close], return_index=True)
    rows = np.flatnonzero(close)[np.sort(once)]
    return np.stack([rows, nearest[rows]], -1)


def _refine(pose: Array, observed: Points, landmarks: Points, tree: cKDTree) -> Relocation | None:
    """Weighted least squares over all pairs, by Gauss-Newton; None if it loses them."""
    for _ in range(_ROUNDS):
        pairs = _pairs(pose, observed, landmarks, tree)
        if len(pairs) < 2:
            return None
        i, j = pairs.T
        z, H, R = to_sensor(pose, landmarks.xy[j])
        weights = np.linalg.inv(observed.covariance[i] + R @ landmarks.covariance[j] @ R.T)
        information = np.einsum("pki,pkl,plj->ij", H, weights, H)
        pose = pose + np.linalg.solve(information, np.einsum("pki,pkl,pl->i", H, weights, observed.xy[i] - z))
        pose[2] = wrap(pose[2])
    return Relocation(pose, np.linalg.inv(information), pairs)


def _unexplained(min_pairs: int, observed: Points) -> LostError:
    return LostError(
        f"No pose explains {min_pairs} of the {len(observed)} points seen: move on and try again."
    )


def _same(pose: Array, other: Array) -> bool:
    difference = pose - other
    difference[2] = wrap(difference[2])
    return bool((np.abs(difference) < _SAME).all())
