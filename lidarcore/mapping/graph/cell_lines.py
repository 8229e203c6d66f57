"""The line through what several keyframes saw in a cell of an adjustment: robust against what is of something else."""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.compiled import kernel

UPRIGHT = 1.0  # 1/rad², with which a cell's line is held across the mean of its normals: patches tell more
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


class Noise(NamedTuple):
    """A patch has `scale` times its own variance, and all patches of a group share `unevenness` m²."""

    scale: float
    unevenness: float


class CellFit(NamedTuple):
    """What is known of one cell after another: of M patches those that lie in it.

    r, t     (M,) m, how far each lies across and along, from their middle
    weights  (M,) 1/m² of each, in the line
    N        (2, 2) information of the line's a and b
    """

    r: Array
    t: Array
    weights: Array
    N: Array


@kernel
def fit_line(
    turned: Observations, poses: Array, noise: Noise, low: int, high: int, fit: CellFit
) -> tuple[float, float, float, float]:
    """Normal (2) of a cell, whose patches are those from `low` to before `high`, and its line r = a + b t, robustly.

    Where the line says clearly that the mean of the normals is not its own, it is fitted once more across its own.
    """
    nx, ny = _normal(turned, low, high)
    a, b = _fit_across(turned, poses, noise, nx, ny, low, high, fit)
    N = fit.N
    if b * b * (N[0, 0] * N[1, 1] - N[0, 1] * N[0, 1]) > _BENT * N[0, 0]:
        nx, ny = (nx + b * ny) / np.hypot(1.0, b), (ny - b * nx) / np.hypot(1.0, b)
        a, b = _fit_across(turned, poses, noise, nx, ny, low, high, fit)
    return nx, ny, a, b


@kernel
def _fit_across(
    turned: Observations, poses: Array, noise: Noise, nx: float, ny: float, low: int, high: int, fit: CellFit
) -> tuple[float, float]:
    """The line r = a + b t, r being measured along this normal."""
    _lie(turned, poses, nx, ny, low, high, fit)
    _weigh(turned, noise, low, high, fit.weights)
    return _fit(turned, noise, low, high, fit)


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
def _lie(turned: Observations, poses: Array, nx: float, ny: float, low: int, high: int, fit: CellFit) -> None:
    """How far the patches of a cell lie across and along, from their middle."""
    keyframes, arms = turned.keyframes, turned.means
    x = y = 0.0
    for i in range(low, high):
        x += poses[keyframes[i], 0] + arms[i, 0]
        y += poses[keyframes[i], 1] + arms[i, 1]
    x, y = x / (high - low), y / (high - low)
    for i in range(low, high):
        u, v = poses[keyframes[i], 0] + arms[i, 0] - x, poses[keyframes[i], 1] + arms[i, 1] - y
        fit.r[i], fit.t[i] = nx * u + ny * v, nx * v - ny * u


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
def _fit(turned: Observations, noise: Noise, low: int, high: int, fit: CellFit) -> tuple[float, float]:
    """Robust line r = a + b t; leaves the weights and the information that it ended with."""
    r, t, weights, N, a, b = fit.r, fit.t, fit.weights, fit.N, 0.0, 0.0
    for turn in range(_PASSES):
        N[:], m0, m1 = 0.0, 0.0, 0.0
        N[1, 1] = UPRIGHT
        for i in range(low, high):
            w = weights[i]
            N[0, 0] += w
            N[0, 1] += w * t[i]
            N[1, 1] += w * t[i] * t[i]
            m0 += w * r[i]
            m1 += w * r[i] * t[i]
        N[1, 0] = N[0, 1]
        det = N[0, 0] * N[1, 1] - N[0, 1] * N[0, 1]
        a, b = (N[1, 1] * m0 - N[0, 1] * m1) / det, (N[0, 0] * m1 - N[0, 1] * m0) / det
        if turn < _PASSES - 1:
            _weigh(turned, noise, low, high, weights)
            for i in range(low, high):
                off = (r[i] - a - b * t[i]) ** 2 / (noise.scale * turned.variances[i] + noise.unevenness)
                if off > _OUTLIER:
                    weights[i] *= (_OUTLIER / off) ** 2
    return a, b
