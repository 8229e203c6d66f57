"""The cells of an adjustment: in each the line through what all keyframes saw, and what is left without that line."""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.compiled import kernel

_TILT = 1.0  # rad of a cell's line from the mean of its normals: held to 0.1, maps of long corridors bent
_OUTLIER = 9.0  # squared standard deviations from which on a patch counts less
_BENT = 16.0  # squared standard deviations by which one of hundreds of lines is turned, if not by chance
_PASSES = 4  # over a cell, until outliers no longer move its line


class Observations(NamedTuple):
    """M patches, sorted by the cells that they lie in and by keyframe.

    keyframes  (M,) which keyframe saw each
    means      (M, 2) m, frame of the keyframe
    normals    (M, 2)
    variances  (M,) m² of noise
    near       (M,) whether returns near each other make it, see Patches.counts
    since      (M,) s from the mean time of its keyframe's beams until it was seen
    """

    keyframes: Ints
    means: Array
    normals: Array
    variances: Array
    near: Bools
    since: Array


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


class Noise(NamedTuple):
    """A patch has `scale` times its own variance, and all patches of a group share `unevenness` m²."""

    scale: float
    unevenness: float


class Sums(NamedTuple):
    """What the G groups of K keyframes add up to: D - U U^T is the information, U's columns are those of the lines.

    D (K, n, n), g (K, n); U (G, n, 2) with keyframe and line of each, at (G, 2). With n = 3 it is that of poses, with
    n = 6 that of poses and of how much faster, m/s, m/s, rad/s in the map, the sensor moved than was taken out.
    """

    D: Array
    g: Array
    U: Array
    at: Ints


class _Scratch(NamedTuple):
    """Of one cell at a time: how far patches lie across and along, from their middle, m, and their weights."""

    r: Array
    t: Array
    weights: Array


@kernel
def sum_cells(
    turned: Observations, starts: Ints, poses: Array, noise: Noise, sums: Sums, groups: Groups
) -> tuple[int, int]:
    """Adds up the cells that several keyframes saw, patches turned as the map is; the number of groups and of cells."""
    keyframes, arms, variances = turned.keyframes, turned.means, turned.variances
    D, g, U, at = sums.D, sums.g, sums.U, sums.at
    number, lines, n = 0, 0, D.shape[1]
    N, m, S, J = np.empty((2, 2)), np.empty(2), np.empty((n, 2)), np.empty(n)
    r, t, weights = np.empty(len(keyframes)), np.empty(len(keyframes)), np.empty(len(keyframes))
    scratch = _Scratch(r, t, weights)
    for cell in range(len(starts) - 1):
        low, high = starts[cell], starts[cell + 1]
        if keyframes[low] == keyframes[high - 1]:
            continue
        nx, ny = _normal(turned, low, high)
        _lie(turned, poses, nx, ny, low, high, scratch)
        _weigh(turned, noise, low, high, weights)
        a, b = _fit(turned, noise, low, high, scratch, N, m)
        if b * b * (N[0, 0] * N[1, 1] - N[0, 1] * N[0, 1]) > _BENT * N[0, 0]:
            nx, ny = (nx + b * ny) / np.hypot(1.0, b), (ny - b * nx) / np.hypot(1.0, b)
            _lie(turned, poses, nx, ny, low, high, scratch)
            _weigh(turned, noise, low, high, weights)
            a, b = _fit(turned, noise, low, high, scratch, N, m)
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


@kernel
def _normal(turned: Observations, low: int, high: int) -> tuple[float, float]:
    """Mean of the normals in a cell."""
    nx = ny = 0.0
    for i in range(low, high):
        nx += turned.normals[i, 0]
        ny += turned.normals[i, 1]
    norm = np.hypot(nx, ny)
    return nx / norm, ny / norm


@kernel
def _lie(
    turned: Observations, poses: Array, nx: float, ny: float, low: int, high: int, scratch: _Scratch
) -> None:
    """How far the patches of a cell lie across and along, from their middle."""
    keyframes, arms = turned.keyframes, turned.means
    x = y = 0.0
    for i in range(low, high):
        x += poses[keyframes[i], 0] + arms[i, 0]
        y += poses[keyframes[i], 1] + arms[i, 1]
    x, y = x / (high - low), y / (high - low)
    for i in range(low, high):
        u, v = poses[keyframes[i], 0] + arms[i, 0] - x, poses[keyframes[i], 1] + arms[i, 1] - y
        scratch.r[i], scratch.t[i] = nx * u + ny * v, nx * v - ny * u


@kernel
def _weigh(turned: Observations, noise: Noise, low: int, high: int, weights: Array) -> None:
    """Weight of each patch: its noise, and what it shares with the others of its group."""
    keyframes, i = turned.keyframes, low
    while i < high:
        j = i
        while j < high and keyframes[j] == keyframes[i]:
            j += 1
        for k in range(i, j):
            weights[k] = 1 / (noise.scale * turned.variances[k] + (j - i) * noise.unevenness)
        i = j


@kernel
def _fit(
    turned: Observations, noise: Noise, low: int, high: int, scratch: _Scratch, N: Array, m: Array
) -> tuple[float, float]:
    """Robust line r = a + b t; leaves the weights and the information N (2, 2) that it ended with."""
    r, t, weights, a, b = scratch.r, scratch.t, scratch.weights, 0.0, 0.0
    for turn in range(_PASSES):
        N[:], m[:] = 0.0, 0.0
        N[1, 1] = 1 / _TILT**2
        for i in range(low, high):
            w = weights[i]
            N[0, 0] += w
            N[0, 1] += w * t[i]
            N[1, 1] += w * t[i] * t[i]
            m[0] += w * r[i]
            m[1] += w * r[i] * t[i]
        N[1, 0] = N[0, 1]
        det = N[0, 0] * N[1, 1] - N[0, 1] * N[0, 1]
        a, b = (N[1, 1] * m[0] - N[0, 1] * m[1]) / det, (N[0, 0] * m[1] - N[0, 1] * m[0]) / det
        if turn < _PASSES - 1:
            _weigh(turned, noise, low, high, weights)
            for i in range(low, high):
                off = (r[i] - a - b * t[i]) ** 2 / (noise.scale * turned.variances[i] + noise.unevenness)
                if off > _OUTLIER:
                    weights[i] *= (_OUTLIER / off) ** 2
    return a, b
