"""What all patches of all keyframes say about their poses, the surfaces being unknown as well.

Surfaces are cut into cells. In each, what the keyframes saw is a line of unknown place and direction, which is
eliminated: what remains ties all keyframes that saw it to each other, each piece of information used once
[Triggs et al. 2000; Liu & Zhang, BALM, RA-L 2021].
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import rotate
from lidarcore.mapping.cells import cells
from lidarcore.mapping.graph.adjustment_cells import Groups, Noise, Observations, Sums, sum_cells
from lidarcore.mapping.graph.known import Known, parted

_GAP = 0.15  # m between two surfaces side by side
_WITHIN = 0.03  # m by which the returns of a patch scatter along it
_STRETCH = 4  # cells, of which a line tells the direction of the surface better than each of them
_BEYOND = 1e6  # m between two islands


class NormalEquations(NamedTuple):
    """The normal equations of K poses, without the lines of the cells, and what is left of each group.

    information  (3 K, 3 K) sparse
    gradient     (3 K,)
    """

    information: csr_array
    gradient: Array
    groups: Groups


def normal_equations(
    seen: Observations,
    poses: Array,
    islands: Ints,
    size: float,
    scale: float,
    unevenness: float,
    known: Known | None = None,
) -> NormalEquations:
    """The normal equations at poses (K, 3), by the cells that several keyframes of one island (K,) saw.

    The variance of a patch is scale times that of its noise; what all patches of a group share is unevenness m.
    Cells are parted where parts of the way are not known, seen from each other.
    """
    arms, normals = (rotate(poses[seen.keyframes, 2], v) for v in (seen.means, seen.normals))
    places = arms + poses[seen.keyframes, :2] + _BEYOND * islands[seen.keyframes, None]
    order, starts = _ordered(places, normals, size, seen.keyframes, known)
    normals = _straight(places, normals, seen.variances, size)
    turned = Observations(
        seen.keyframes[order], arms[order], normals[order], seen.variances[order], seen.near[order]
    )
    K, G = len(poses), len(order)
    sums = Sums(np.zeros((K, 3, 3)), np.zeros((K, 3)), np.empty((G, 3, 2)), np.empty((G, 2), np.int64))
    groups = Groups(*np.empty((4, G)))
    number, lines = sum_cells(turned, starts, poses, Noise(scale, unevenness**2), sums, groups)
    information = _sparse(sums.D, sums.U[:number], sums.at[:number], lines)
    return NormalEquations(information, sums.g.ravel(), Groups(*(v[:number] for v in groups)))


def _straight(places: Array, normals: Array, variances: Array, size: float) -> Array:
    """Normals (M, 2) of the lines through the stretches of surface, some cells long, that patches are of.

    Each cell has a direction of its own only if it says so: errors of many short ones, which point ahead in a bare
    corridor now and behind then, would pass for knowledge of how far one went.
    """
    number = cells(places, normals, _STRETCH * size, _GAP)
    weights = 1 / variances

    def mean(values: Array) -> Array:
        return np.bincount(number, weights * values) / total

    total = np.bincount(number, weights)
    n = np.stack([mean(normals[:, 0]), mean(normals[:, 1])], -1)
    n = (n / np.hypot(n[:, 0], n[:, 1])[:, None])[number]
    across, along = (n * places).sum(-1), n[:, 0] * places[:, 1] - n[:, 1] * places[:, 0]
    r, t = across - mean(across)[number], along - mean(along)[number]
    slope = (mean(r * t) / (mean(t * t) + _WITHIN**2))[number]
    straight: Array = rotate(-np.arctan(slope), n)
    return straight


def _ordered(
    places: Array, normals: Array, size: float, keyframes: Ints, known: Known | None
) -> tuple[Ints, Ints]:
    """Order of patches by cell and keyframe, and where each cell begins, with the end."""
    number = cells(places, normals, size, _GAP)
    order = np.lexsort([keyframes, number])
    if known is not None:
        number[order] = parted(number[order], known.part[keyframes[order]], known.pairs)
        order = np.lexsort([keyframes, number])
    return order, np.append(np.flatnonzero(np.diff(number[order], prepend=-1)), len(order))


def _sparse(D: Array, U: Array, at: Ints, lines: int) -> csr_array:
    """D less U U^T."""
    K = len(D)
    rows = (3 * at[:, 0, None, None] + np.arange(3)[:, None] + 0 * np.arange(2)).ravel()
    columns = (2 * at[:, 1, None, None] + 0 * np.arange(3)[:, None] + np.arange(2)).ravel()
    tall = coo_array((U.ravel(), (rows, columns)), shape=(3 * K, 2 * lines)).tocsr()
    index = 3 * np.arange(K)[:, None, None] + np.zeros((3, 3), np.int64)
    diagonal = coo_array(
        (D.ravel(), ((index + np.arange(3)[:, None]).ravel(), (index + np.arange(3)).ravel())),
        shape=(3 * K, 3 * K),
    )
    return csr_array(diagonal.tocsr() - tall @ tall.T)
