"""The cells of an adjustment: what the line through each leaves of what every keyframe saw there."""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import kernel
from lidarcore.mapping.graph.cell_lines import UPRIGHT, CellFit, Noise, Observations, fit_line


class Groups(NamedTuple):
    """What is left of G groups, each of the patches of one keyframe in one cell.

    squares    (G,) m² of the residual of their mean
    variances  (G,) m² of that mean by noise alone
    left       (G,) share of the square that the line did not take up
    near       (G,) 1 where returns near each other make the first of its patches, else 0
    """

    squares: Array
    variances: Array
    left: Array
    near: Array


class Sums(NamedTuple):
    """What the G groups of K keyframes add up to: D - U U^T is the information, U's columns are those of the lines.

    D (K, n, n), g (K, n); U (G, n, 2) with keyframe and line of each, at (G, 2). With n = 3 it is that of poses, with
    n = 6 that of poses and of how much faster, m/s, m/s, rad/s in the map, the sensor moved than was taken out.
    """

    D: Array
    g: Array
    U: Array
    at: Ints


@kernel
def sum_cells(
    turned: Observations, starts: Ints, poses: Array, noise: Noise, sums: Sums, groups: Groups
) -> tuple[int, int]:
    """Adds up the cells that several keyframes saw, patches turned as the map is; the number of groups and of cells."""
    keyframes, arms, variances = turned.keyframes, turned.means, turned.variances
    D, g, U, at = sums.D, sums.g, sums.U, sums.at
    number, lines, n = 0, 0, D.shape[1]
    N, S, J = np.empty((2, 2)), np.empty((n, 2)), np.empty(n)
    r, t, weights = np.empty(len(keyframes)), np.empty(len(keyframes)), np.empty(len(keyframes))
    fit = CellFit(r, t, weights, N)
    for cell in range(len(starts) - 1):
        low, high = starts[cell], starts[cell + 1]
        if keyframes[low] == keyframes[high - 1]:
            continue
        nx, ny, a, b = fit_line(turned, poses, noise, low, high, fit)
        det, l00, l10, l11 = _inverse_root(N)
        i = low
        while i < high:
            k, j = keyframes[i], i
            S[:] = 0.0
            mean, information, lever, total = 0.0, 0.0, 0.0, 0.0
            while j < high and keyframes[j] == k:
                w, left = weights[j], r[j] - a - b * t[j]
                J[0], J[1], J[2] = nx, ny, ny * arms[j, 0] - nx * arms[j, 1]
                for p in range(3, n):
                    J[p] = turned.since[j] * J[p - 3]
                for p in range(n):
                    g[k, p] += w * J[p] * left
                    S[p, 0] += w * J[p]
                    S[p, 1] += w * J[p] * t[j]
                    for q in range(n):
                        D[k, p, q] += w * J[p] * J[q]
                mean += left / variances[j]
                information += 1 / variances[j]
                lever += w * t[j]
                total += w
                j += 1
            if i == low:  # as normals do, the line turns with who saw it: no cell tells how the map is turned
                D[k, 2, 2] += UPRIGHT
                S[2, 1] -= UPRIGHT
                g[k, 2] += UPRIGHT * b
            for p in range(n):
                U[number, p, 0] = S[p, 0] * l00 + S[p, 1] * l10
                U[number, p, 1] = S[p, 1] * l11
            at[number, 0], at[number, 1] = k, lines
            lever /= max(total, 1e-12)
            leverage = total * (N[1, 1] - 2 * N[0, 1] * lever + N[0, 0] * lever * lever) / det
            groups.squares[number], groups.variances[number] = (mean / information) ** 2, 1 / information
            groups.left[number], groups.near[number] = 1 - leverage, turned.near[i]
            number += 1
            i = j
        lines += 1
    return number, lines


@kernel
def take_lines(D: Array, U: Array, keyframes: Ints) -> None:
    """Take from D (K, n, n) of each keyframe what its groups U (G, n, 2) do not say as lines are unknown: U U^T."""
    n = D.shape[1]
    for i in range(len(U)):
        own, u = D[keyframes[i]], U[i]
        for p in range(n):
            for q in range(n):
                own[p, q] -= u[p, 0] * u[q, 0] + u[p, 1] * u[q, 1]


@kernel
def _inverse_root(N: Array) -> tuple[float, float, float, float]:
    """Determinant of N (2, 2), and the lower triangle of L, where N^-1 = L L^T."""
    det = N[0, 0] * N[1, 1] - N[0, 1] * N[0, 1]
    l00 = np.sqrt(N[1, 1] / det)
    l10 = -N[0, 1] / det / l00
    return det, l00, l10, np.sqrt(max(N[0, 0] / det - l10 * l10, 0.0))
