"""Which parts of a way are known, seen from each other, so well that a surface seen from both is one.

Where a graph is vaguer than surfaces lie apart, those of two passes that seem to coincide need not be the same.
"""

from typing import NamedTuple, Protocol

import numpy as np

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.compiled import kernel
from lidarcore.geometry import UncertainPose

_NO_TIES = np.empty((0, 2), np.int64)
_TOGETHER = 16  # successive keyframes that are judged as one part of the way, at most


class JointPoses(Protocol):
    """Poses that are known together: a pose graph, or what was adjusted."""

    @property
    def poses(self) -> Array:
        """(K, 3) of keyframes: m, m, rad."""

    def relative(self, i: int, j: int) -> UncertainPose:
        """T_i_j (3,) and its covariance (3, 3)."""


class Known(NamedTuple):
    """Which parts of a way are known, seen from each other.

    part     (K,) number of the part that each keyframe is of
    pairs    (S, S) of the parts; not told of two that lie too far apart to have seen a surface both
    reaches  (K,) m, how far each keyframe saw; 0 if it saw so little that no surface is known to be another's, too
    """

    part: Ints
    pairs: Bools
    reaches: Array


def known(joint: JointPoses, within: float, steps: Array, reaches: Array, ties: Ints = _NO_TIES) -> Known:
    """The parts of a way; two are known if the place of one, seen from the other, has a deviation below `within` m.

    A part's place is its middle, or where one of the ties (L, 2), from keyframe to keyframe, begins or ends: seen from
    there, the rest of a part is known as well, but from the middles of both it need not be.

    steps (K - 1, 3, 3) are the covariances of the keyframes, each seen from the one before it. Neighbours are known if
    the step between them is, unless one saw too little: reaches (K,) m tell how far each saw, 0 if that is so.
    """
    variances = steps[:, 0, 0] + steps[:, 1, 1]
    variances[(reaches[:-1] == 0) | (reaches[1:] == 0)] = np.inf
    part, reached = _parts(variances, within**2)
    pairs = np.eye(part[-1] + 1, dtype=bool)
    a = np.flatnonzero(reached)
    pairs[a, a + 1] = pairs[a + 1, a] = True
    for i, j in ties[(reaches[ties] > 0).all(axis=1)].tolist():
        if _is_known(joint, i, j, within):
            pairs[part[i], part[j]] = pairs[part[j], part[i]] = True
    return known_besides(Known(part, pairs, reaches), joint, within)


def _parts(variances: Array, most: float) -> tuple[Ints, Bools]:
    """Numbers (K,) of the parts, in which the variances (K - 1,) m² of the steps add up to less than `most`.

    And whether each part but the first was reached from the one before it by a step that is known as well.
    """
    part, reached = np.zeros(len(variances) + 1, np.int64), []
    count, total = 1, 0.0
    for k, variance in enumerate(variances.tolist(), 1):
        count, total, part[k] = count + 1, total + variance, part[k - 1]
        if count > _TOGETHER or total >= most:
            count, total, part[k] = 1, 0.0, part[k - 1] + 1
            reached.append(variance < most)
    return part, np.array(reached, bool)


def known_besides(parts: Known, joint: JointPoses, within: float) -> Known:
    """The same parts, of which those are known that were before, and those that the joint poses know now."""
    pairs = parts.pairs.copy()
    for b, a in np.argwhere(np.tril(_overlap(parts, joint.poses) & ~pairs)).tolist():
        pairs[b, a] = pairs[a, b] = _is_known(joint, _middle(parts, a), _middle(parts, b), within)
    return parts._replace(pairs=pairs)


def near_unknown(joint: JointPoses, known: Known, distance: float) -> Ints:
    """Keyframes within a distance in m of earlier ones that are not known, seen from there."""
    places, part, found = joint.poses[:, :2], known.part, []
    unknown = _overlap(known, joint.poses) & ~known.pairs
    for k, place in enumerate(places):
        others = places[:k][unknown[part[k], part[:k]]]
        if (np.hypot(*(others - place).T) < distance).any():
            found.append(k)
    return np.array(found, np.int64)


def _overlap(parts: Known, poses: Array) -> Bools:
    """(S, S): whether what two parts saw from poses (K, 3) lies in circles that overlap: else no surface is of both."""
    begins = np.flatnonzero(np.diff(parts.part, prepend=-1))
    centres = np.add.reduceat(poses[:, :2], begins) / np.bincount(parts.part)[:, None]
    farthest = np.hypot(*(poses[:, :2] - centres[parts.part]).T) + parts.reaches
    radii, tells = np.maximum.reduceat(farthest, begins), np.maximum.reduceat(parts.reaches, begins) > 0
    found: Bools = np.hypot(*(centres[:, None] - centres).T) < radii[:, None] + radii
    return found & tells[:, None] & tells


def _middle(parts: Known, number: int) -> int:
    first, end = np.searchsorted(parts.part, [number, number + 1]).tolist()
    return int(first + end) // 2


def _is_known(joint: JointPoses, i: int, j: int, within: float) -> bool:
    P = joint.relative(i, j)[1]
    return bool(P[0, 0] + P[1, 1] < within**2)


@kernel
def parted(cells: Ints, parts: Ints, pairs: Bools) -> Ints:
    """Cells (M,) parted so that none holds what was seen from parts (M,) of the way that no known pairs connect.

    Both come in the order of the cells, and of the parts in each; the cells of the answer are numbered from 0.
    """
    found = np.empty(len(cells), np.int64)
    number, low = -1, 0
    for i in range(len(cells)):
        if i == 0 or cells[i] != cells[i - 1]:
            low = i
        elif parts[i] == parts[i - 1]:
            found[i] = found[i - 1]
            continue
        found[i] = -1
        for j in range(low, i):
            if pairs[parts[j], parts[i]]:
                found[i] = found[j]
                break
        if found[i] < 0:
            number += 1
            found[i] = number
    return found
