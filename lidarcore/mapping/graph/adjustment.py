"""What all patches of all keyframes say about their poses, the surfaces being unknown as well.

Surfaces are cut into cells. In each, what the keyframes saw is a line of unknown place and direction, which is
eliminated: what remains ties all keyframes that saw it to each other, each piece of information used once
[Triggs et al. 2000; Liu & Zhang, BALM, RA-L 2021].
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import rotate, rotation
from lidarcore.mapping.cells import cells
from lidarcore.mapping.graph.adjustment_cells import Groups, Sums, sum_cells, take_lines
from lidarcore.mapping.graph.cell_lines import Noise, Observations
from lidarcore.mapping.graph.equations import NormalEquations
from lidarcore.mapping.graph.known import Known, parted

_GAP = 0.15  # m between two surfaces side by side
_WITHIN = 0.03  # m by which the returns of a patch scatter along it
_STRETCH = 4  # cells, of which a line tells the direction of the surface better than each of them
_BEYOND = 1e6  # m between two islands
_VAGUE = np.array([1.0, 1.0, 1.0, 0.01, 0.01, 0.01])  # information, in m, rad and s, of what no surface tells


class Surfaces(NamedTuple):
    """What the keyframes of K poses saw of surfaces.

    seen     all patches
    islands  (K,) those of different islands saw different surfaces
    size     m, of the cells that surfaces are cut into
    known    cells are parted where parts of the way are not known, seen from each other; None: all of them are
    """

    seen: Observations
    islands: Ints
    size: float
    known: Known | None = None


def normal_equations(surfaces: Surfaces, poses: Array, noise: Noise) -> tuple[NormalEquations, Groups]:
    """The normal equations at poses (K, 3), by the cells that several keyframes of one island saw; what is left of each
    group."""
    sums, groups, lines = _summed(surfaces, poses, noise, 3)
    return NormalEquations(*_sparse(sums.D, sums.U, sums.at, lines), sums.g.ravel()), groups


def speeds_left(surfaces: Surfaces, poses: Array, noise: Noise) -> Array:
    """How much faster the sensor moved, m/s ahead, m/s to the left and rad/s, than was taken out of each scan, and the
    variances of that: (K, 2, 3). The poses (K, 3) are those that solve the normal equations.

    A scan that is still distorted does not lie on what others saw of the same surfaces, wherever it is put.
    """
    sums, _, _ = _summed(surfaces, poses, noise, 6)
    H = sums.D + np.diag(_VAGUE)
    take_lines(H, sums.U, sums.at[:, 0])
    turn = np.zeros((len(poses), 6, 6))
    turn[:, [2, 5], [2, 5]] = 1.0
    turn[:, :2, :2] = turn[:, 3:5, 3:5] = rotation(poses[:, 2])
    H, g = turn.mT @ H @ turn, turn.mT @ sums.g[..., None]
    P = np.linalg.inv(H)
    faster = -(P @ g)[:, 3:, 0]
    return np.stack([faster, np.diagonal(P, axis1=1, axis2=2)[:, 3:]], 1)


def _summed(surfaces: Surfaces, poses: Array, noise: Noise, unknowns: int) -> tuple[Sums, Groups, int]:
    """What all groups add up to, with so many unknowns for each keyframe; what is left of them; number of lines."""
    seen, islands, size, known = surfaces
    arms, normals = (rotate(poses[seen.keyframes, 2], v) for v in (seen.means, seen.normals))
    places = arms + poses[seen.keyframes, :2] + _BEYOND * islands[seen.keyframes, None]
    order, starts = _ordered(places, normals, size, seen.keyframes, known)
    normals = _straight(places, normals, seen.variances, size)
    turned = Observations(
        seen.keyframes[order],
        arms[order],
        normals[order],
        seen.variances[order],
        seen.near[order],
        seen.since[order],
    )
    K, G, n = len(poses), len(order), unknowns
    sums = Sums(np.zeros((K, n, n)), np.zeros((K, n)), np.empty((G, n, 2)), np.empty((G, 2), np.int64))
    groups = Groups(*np.empty((4, G)))
    number, lines = sum_cells(turned, starts, poses, noise, sums, groups)
    sums = sums._replace(U=sums.U[:number], at=sums.at[:number])
    return sums, Groups(*(v[:number] for v in groups)), lines


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


def _sparse(D: Array, U: Array, at: Ints, lines: int) -> tuple[csr_array, csr_array]:
    """D (3 K, 3 K) and U (3 K, 2 L) as sparse matrices."""
    K = len(D)
    rows = (3 * at[:, 0, None, None] + np.arange(3)[:, None] + 0 * np.arange(2)).ravel()
    columns = (2 * at[:, 1, None, None] + 0 * np.arange(3)[:, None] + np.arange(2)).ravel()
    tall = csr_array((U.ravel(), (rows, columns)), shape=(3 * K, 2 * lines))
    index = 3 * np.arange(K)[:, None, None] + np.zeros((3, 3), np.int64)
    own = (index + np.arange(3)[:, None]).ravel(), (index + np.arange(3)).ravel()
    return csr_array((D.ravel(), own), shape=(3 * K, 3 * K)), tall
