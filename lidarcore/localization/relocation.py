"""Where the sensor is in a known map, from nothing: by constellations of landmarks, without a prior pose.

Two observed points and two landmarks equally far apart fix a pose; the pose that explains most of the scan wins
(pairwise geometric hashing with a consensus, as in Fischler and Bolles 1981), and it must win alone.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.errors import LostError
from lidarcore.geometry import (
    act,
    act_inverse,
    act_inverse_jacobians,
    pose_difference,
    squared_mahalanobis,
    wrap,
)
from lidarcore.localization.coincidence import false_alarms
from lidarcore.localization.points import Points

_FAR = 6.0  # standard deviations; what is known of a pose after a gap is rough
_SIGMAS = 4.0
_NEEDED = 4  # pairs at least
_PAIRS = 12  # observed pairs to try, the longest ones: they fix the heading best
_SAME = np.array([0.3, 0.3, 0.2])  # m, m, rad: poses nearer than this are one
_ROUNDS = 4
_MOST_PAIRS = 4_000_000  # of landmarks, within the longest distance seen
_MOST_POSES = 50_000  # hypotheses that are compared with the whole scan
_MOST_REFINED = 100  # hypotheses, the best ones, of which least squares are worth it
_BELIEVED = 0.01  # poses tried that may explain as much by chance
_TOO_LARGE = "A map of {} landmarks is too large to search without a guess: say where the sensor is."


@dataclass(frozen=True, slots=True, eq=False)
class Relocation:
    """A pose found: T_world_sensor (3,) with covariance (3, 3), and its pairs (P, 2) of observation and landmark."""

    pose: Array
    covariance: Array
    pairs: Ints


def relocalize(observed: Points, landmarks: Points, near: tuple[Array, Array] | None = None) -> Relocation:
    """Find the one pose from which the landmarks of the map explain four of the points seen, and half of them.

    near, if given, are a pose (3,) and a covariance (3, 3): only poses within some of its standard deviations count.
    Raises LostError if there is none, or several explain as much: a symmetric room, or too few points; or if the map
    is too large to be searched.
    """
    found: list[Relocation] = []
    _check(observed, landmarks, _NEEDED)
    min_pairs, refined = max(_NEEDED, (len(observed) + 1) // 2), 0
    if min(len(observed), len(landmarks)) < min_pairs:
        raise _unexplained(min_pairs, observed)
    tree = cKDTree(landmarks.xy)
    poses = _hypotheses(observed, landmarks, tree)
    poses = poses if near is None else poses[_are_near(poses, *near)]
    counts = _counts(poses, observed, landmarks, tree)
    for index in np.argsort(-counts, kind="stable")[: np.sum(counts >= min_pairs)]:
        pose = poses[index]
        if found and counts[index] < max(len(known.pairs) for known in found):
            break
        if not any(_same(pose, known.pose) for known in found):
            if refined == _MOST_REFINED:
                raise LostError(
                    f"More than {refined} poses explain about as much of the scan: say where the sensor is."
                )
            refined += 1
            candidate = _refine(pose, observed, landmarks, tree)
            if candidate and not any(_same(candidate.pose, known.pose) for known in found):
                found.append(candidate)
    found.sort(key=lambda relocation: -len(relocation.pairs))
    if not found or len(found[0].pairs) < min_pairs:
        raise _unexplained(min_pairs, observed)
    if len(found) > 1 and len(found[1].pairs) == len(found[0].pairs):
        raise LostError(
            f"Several poses explain {len(found[0].pairs)} of the {len(observed)} points seen, such as "
            f"{found[0].pose.round(2)} and {found[1].pose.round(2)}: move the sensor, or set the pose by hand."
        )
    if false_alarms(found[0].pose, found[0].pairs, observed, landmarks, len(poses)) > _BELIEVED:
        raise LostError(
            f"The pose was not found: {len(found[0].pairs)} of the {len(observed)} points seen match the map at "
            f"{found[0].pose.round(2)}, but as many may match by chance elsewhere. "
            "Move the sensor and try again, or set the pose by hand."
        )
    return found[0]


def _are_near(poses: Array, pose: Array, covariance: Array) -> Bools:
    """(H,) true for the poses within _FAR standard deviations of a pose."""
    return np.asarray(squared_mahalanobis(pose_difference(poses, pose), covariance) < _FAR**2)


def _check(observed: Points, landmarks: Points, needed: int) -> None:
    """Raise LostError if no scan like this one could tell the pose in this map."""
    if len(landmarks) < needed:
        raise LostError(
            f"The map has {len(landmarks)} landmarks, and {needed} are needed to find a pose in it: "
            "set the pose by hand, or map more of the room."
        )
    seen, known = set(np.asarray(observed.kinds).tolist()), set(np.asarray(landmarks.kinds).tolist())
    if seen and not seen & known:
        raise LostError(
            f"The map holds no {' or '.join(sorted(seen))} but {', '.join(sorted(known))}: "
            "use those as landmarks, or give another map."
        )


def _hypotheses(observed: Points, landmarks: Points, tree: cKDTree) -> Array:
    """Poses (H, 3) that bring two observed points onto two landmarks of their kinds, the rarest pairs first."""
    i, j = np.triu_indices(len(observed), 1)
    lengths = np.linalg.norm(observed.xy[i] - observed.xy[j], axis=-1)
    longest = np.argsort(-lengths)[:_PAIRS]
    i, j, lengths = i[longest], j[longest], lengths[longest]
    variances = np.trace(observed.covariance, axis1=1, axis2=2)
    tolerance = _SIGMAS * np.sqrt(variances[i] + variances[j])
    a, b, spacing = _spacings(landmarks.xy, tree, float((lengths + tolerance).max()))
    first, last = np.searchsorted(spacing, [lengths - tolerance, lengths + tolerance])
    kinds, known = np.asarray(observed.kinds), np.asarray(landmarks.kinds)
    poses, count = [np.empty((0, 3))], 0
    for pair in np.argsort(last - first):
        count += 2 * int(last[pair] - first[pair])
        if count > _MOST_POSES:
            break
        alike = slice(first[pair], last[pair])
        ends = np.array([[a[alike], b[alike]], [b[alike], a[alike]]]).transpose(1, 0, 2).reshape(2, -1)
        ends = ends[:, (known[ends] == kinds[[i[pair], j[pair]]][:, None]).all(axis=0)]
        poses.append(_onto(observed.xy[[i[pair], j[pair]]], *landmarks.xy[ends]))
    if len(poses) == 1:
        raise LostError(_TOO_LARGE.format(len(landmarks)))
    return np.concatenate(poses)


def _spacings(xy: Array, tree: cKDTree, longest: float) -> tuple[Ints, Ints, Array]:
    """Pairs of landmarks (S,), (S,) that are not farther apart than the longest distance, and how far (S,), rising."""
    if tree.count_neighbors(tree, longest) > 2 * _MOST_PAIRS + len(xy):
        raise LostError(_TOO_LARGE.format(len(xy)))
    a, b = tree.query_pairs(longest, output_type="ndarray").T
    spacing = np.linalg.norm(xy[a] - xy[b], axis=-1)
    rising = np.argsort(spacing)
    return a[rising], b[rising], spacing[rising]


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


def _nearest(placed: Array, observed: Points, landmarks: Points, tree: cKDTree) -> tuple[Ints, Bools]:
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
    nearest, close = _nearest(act(pose, observed.xy), observed, landmarks, tree)
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
        z, (H, R) = act_inverse(pose, landmarks.xy[j]), act_inverse_jacobians(pose, landmarks.xy[j])
        weights = np.linalg.inv(observed.covariance[i] + R @ landmarks.covariance[j] @ R.T)
        information = np.einsum("pki,pkl,plj->ij", H, weights, H)
        pose = pose + np.linalg.solve(information, np.einsum("pki,pkl,pl->i", H, weights, observed.xy[i] - z))
        pose[2] = wrap(pose[2])
    return Relocation(pose, np.linalg.inv(information), pairs)


def _unexplained(min_pairs: int, observed: Points) -> LostError:
    return LostError(
        f"The pose was not found: of {len(observed)} points seen, too few match the map ({min_pairs} are needed). "
        "Move the sensor and try again."
    )


def _same(pose: Array, other: Array) -> bool:
    return bool((np.abs(pose_difference(pose, other)) < _SAME).all())
