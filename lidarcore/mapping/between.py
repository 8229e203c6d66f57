"""How well the scans between keyframes are placed in a finished map.

They hang on keyframes, which were placed by all that was seen, by what the front end saw. A scan shares its keyframe's
error, as both lie on the same surfaces, but for what the front end placed it otherwise than the finished map would.
How much that is, the keyframes tell, which both have placed.
"""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import pose_difference, relative
from lidarcore.mapping.graph.refinement import Refined, turned

_SOME = 50  # steps that tell what the map keeps
_LARGEST = 9.0  # a squared normalised difference counts no more: a keyframe may be found elsewhere after all


class Ties(NamedTuple):
    """How T scans hang on keyframes.

    nodes    (T,) numbers of the keyframes
    poses    (T, 3) T_node_scan
    matched  (T, 3, 3) covariance of the pose by what the scan saw and by motion
    driven   (T, 3, 3) covariance that it would have by motion alone
    sweeps   (T, 3, 3) of where the scan stands, seen from where the sensor was at its stamp; keyframes have their own
    """

    nodes: Ints
    poses: Array
    matched: Array
    driven: Array
    sweeps: Array


def covariances(refined: Refined, local: Array, numbers: Ints, ties: Ties) -> Array:
    """(T, 3, 3) of the poses of all scans, as seen from the first.

    local (K, 3) are the keyframes as the front end had them, numbers (K,) which scans they are.
    """
    is_between = np.ones(len(ties.nodes), np.bool_)
    is_between[numbers] = False
    nodes, poses, own = ties.nodes.copy(), ties.poses.copy(), ties.sweeps.copy()
    share = _replaced(refined, local, np.diagonal(ties.matched[numbers], axis1=1, axis2=2))
    own[numbers] = refined.sweeps
    reduced = _reduced(ties.matched[is_between], ties.driven[is_between], share)
    own[is_between] += turned(reduced, -poses[is_between, 2])  # seen from the scans
    if len(numbers) > 1:
        # Seen from itself the first keyframe has no error that others could share; with the second they share both's.
        first = is_between & (nodes == 0)
        poses[first] = relative(relative(refined.poses[0], refined.poses[1]), poses[first])
        nodes[first] = 1
    P = refined.hung(nodes, poses, own)
    P[0] = 0.0
    return P


def kept(refined: Refined, scatter: Array) -> Array:
    """How much (3,) of the errors with which single scans are placed, ahead, to the left and in heading, the finished
    map has, too. Some of the steps tell it that surfaces tie.

    scatter (K, 3) are the variances of these errors. An estimate that makes the most of what is known shares with any
    other one its whole variance [Hausman, Econometrica 1978, lemma 2.1].
    """
    joined = np.flatnonzero(refined.joined)
    some = joined[:: max(1, len(joined) // _SOME)]
    variances = [np.diagonal(refined.placed(k, k + 1).covariance) for k in some.tolist()]
    if not variances:
        return np.ones(3)
    shares = np.median(variances / (scatter[some] + scatter[some + 1]), axis=0)
    return np.minimum(shares, 1.0)


def _replaced(refined: Refined, local: Array, variances: Array) -> float:
    """Share of variances (K, 3) by which the map places keyframes otherwise than the front end, where surfaces tell."""
    if not refined.joined.any():
        return 1.0
    poses = refined.poses
    off = pose_difference(relative(poses[:-1], poses[1:]), relative(local[:-1], local[1:]))
    squares = off**2 / (variances[1:] + variances[:-1])
    return float(np.minimum(squares, _LARGEST)[refined.joined].mean())


def _reduced(matched: Array, driven: Array, share: float) -> Array:
    """Covariances (T, 3, 3) `matched`, if scans tell more than they claim: `share` of the variance, but where motion
    alone tells.
    """
    L = np.linalg.cholesky(driven)
    back = np.linalg.inv(L)
    values, V = np.linalg.eigh(back @ matched @ back.mT)
    scanned = np.maximum(1 / values - 1, 0.0)  # information by scans, in units of that by motion
    reduced: Array = L @ (V * np.where(scanned > 0, 1 / (scanned / share + 1), values)[:, None]) @ V.mT @ L.mT
    return reduced
