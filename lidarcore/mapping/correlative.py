"""Correlative scan matching: the best pose in a window, wherever the guess lies in it [Olson, ICRA 2009].

The reference is a grid of scores. Blocks of shifts are judged at once on a grid of the largest scores around, which
never underrates them, and only blocks that may hold the best shift are looked into.
"""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import kernel
from lidarcore.geometry import wrap
from lidarcore.geometry.kernels import rotate
from lidarcore.mapping.settings import MatchSettings

_SHIFT = 3
_BLOCK = 1 << _SHIFT  # cells, side of a block of shifts
_CLOSE, _CLOSE_TURN = 0.5, 0.25  # m and rad within which two poses are one
_WIDE = 1.0  # m to either side from which on a window is searched in cells of twice the size
_ENOUGH = 120  # points that tell one pose from another; more cost time only
_REACH = 3  # standard deviations, of the window and of the blur


_NO_POSES = np.empty((0, 3))


class _Window(NamedTuple):
    """What poses are tried, around a guess, and which of them do not count; shifts and places in cells.

    guess   (3,)
    half    (2,) blocks to either side
    turns   (T,) rad
    sigma   (3,) standard deviations of the guess
    others  (E, 3) shifts and turns of poses that are left out, with all within `close`, cells and rad (2,)
    """

    guess: Array
    half: Ints
    turns: Array
    sigma: Array
    others: Array
    close: Array


def search(
    reference: Array,
    points: Array,
    guess: Array,
    sigma: Array,
    settings: MatchSettings,
    besides: Array = _NO_POSES,
) -> Array:
    """T_reference_sensor (3,) at which points (N, 2) m fit the reference points (M, 2) m best.

    Looks three standard deviations sigma (3,) around the guess (3,), up to the settings' limits; where several
    poses fit alike (along a corridor), the one nearest to the guess wins. The guess itself if no point is near.
    Poses close to those of `besides` (E, 3) are left out: what else might it be?
    """
    most = np.minimum(_REACH * sigma, [settings.max_shift, settings.max_shift, settings.max_turn])
    cell = settings.cell * (2 if most[:2].max() > _WIDE else 1)
    near = points[np.hypot(*points.T) < settings.horizon]
    near = near[:: max(1, len(near) // _ENOUGH)]
    kept = reference[np.hypot(*(reference - guess[:2]).T) < settings.horizon + most[0]]
    if not len(near) or not len(kept):
        return guess
    low, fine = _grid(kept, cell, max(settings.blur, cell))
    step = cell / max(
        1.0, float(np.percentile(np.hypot(*near.T), 80))
    )  # rad that move far points by one cell
    turns = step * np.arange(-np.floor(most[2] / step), np.floor(most[2] / step) + 1)
    half = np.ceil(most[:2] / cell / _BLOCK).astype(np.int64)
    unit = np.array([cell, cell, 1.0])
    others = (besides - guess) / unit
    others[:, 2] = wrap(others[:, 2])
    centre = np.array([*(guess[:2] - low) / cell, guess[2]])
    window = _Window(centre, half, turns, sigma / unit, others, np.array([_CLOSE / cell, _CLOSE_TURN]))
    found: Array = guess + np.array(_search(fine, _blocks(fine), near / cell, window)) * unit
    return found


def _grid(points: Array, cell: float, blur: float) -> tuple[Array, Array]:
    """Corner (2,) m of a grid around the points, and its scores: 1 at a point, falling off like a Gaussian."""
    margin = _REACH * blur + _BLOCK * cell
    low = points.min(axis=0) - margin
    blocks = np.ceil((points.max(axis=0) + margin - low) / cell / _BLOCK).astype(np.int64)
    grid = np.zeros(blocks * _BLOCK, np.float32)
    _splat((points - low) / cell, blur / cell, grid)
    return low, grid


@kernel
def _splat(points: Array, blur: float, grid: Array) -> None:
    """Largest of the Gaussians around the points, all in cells."""
    reach = int(np.ceil(_REACH * blur))
    for k in range(len(points)):
        u, v = points[k]
        for i in range(max(int(u) - reach, 0), min(int(u) + reach + 1, grid.shape[0])):
            for j in range(max(int(v) - reach, 0), min(int(v) + reach + 1, grid.shape[1])):
                score = np.exp(-((i + 0.5 - u) ** 2 + (j + 0.5 - v) ** 2) / (2 * blur * blur))
                grid[i, j] = max(grid[i, j], score)


def _blocks(fine: Array) -> Array:
    """Largest score in each block and its next neighbours: what a point of the block can meet within a block's side."""
    rows, columns = np.array(fine.shape) // _BLOCK
    own = np.pad(fine.reshape(rows, _BLOCK, columns, _BLOCK).max(axis=(1, 3)), ((0, 1), (0, 1)))
    largest: Array = np.maximum(
        np.maximum(own[:-1, :-1], own[1:, :-1]), np.maximum(own[:-1, 1:], own[1:, 1:])
    )
    return largest


@kernel
def _search(fine: Array, blocks: Array, points: Array, window: _Window) -> tuple[float, float, float]:
    """Best shift, in cells, and turn: the bounds of all blocks first, then the blocks from the best bound on."""
    turns, half, sigma = window.turns, window.half, window.sigma
    u, v = np.empty(len(points)), np.empty(len(points))
    bounds = np.empty((len(turns), 2 * half[0] + 1, 2 * half[1] + 1))
    for t in range(len(turns)):
        _place(points, window.guess, turns[t], u, v)
        for a in range(bounds.shape[1]):
            for b in range(bounds.shape[2]):
                du, dv = (a - half[0]) * _BLOCK, (b - half[1]) * _BLOCK
                # The shift of the block that is nearest to the guess has the smallest penalty.
                penalty = _penalty(
                    min(max(du, 0), du + _BLOCK - 1), min(max(dv, 0), dv + _BLOCK - 1), turns[t], sigma
                )
                bounds[t, a, b] = _score(blocks, u, v, du, dv, _SHIFT) - penalty
    best, best_u, best_v, best_turn, placed = -np.inf, 0.0, 0.0, 0.0, -1
    flat = bounds.ravel()
    for n in np.argsort(-flat):
        if flat[n] <= best:
            break
        t, a, b = (
            n // (bounds.shape[1] * bounds.shape[2]),
            n // bounds.shape[2] % bounds.shape[1],
            n % bounds.shape[2],
        )
        if t != placed:
            _place(points, window.guess, turns[t], u, v)
            placed = t
        for du in range((a - half[0]) * _BLOCK, (a - half[0] + 1) * _BLOCK):
            for dv in range((b - half[1]) * _BLOCK, (b - half[1] + 1) * _BLOCK):
                if _close(window, du, dv, turns[t]):
                    continue
                total = _score(fine, u, v, du, dv, 0) - _penalty(du, dv, turns[t], sigma)
                if total > best:
                    best, best_u, best_v, best_turn = total, du, dv, turns[t]
    return best_u, best_v, best_turn


@kernel
def _close(window: _Window, du: float, dv: float, turn: float) -> bool:
    """True if a shift in cells and a turn are those of another pose."""
    others, close = window.others, window.close
    for k in range(len(others)):
        away = (others[k, 0] - du) ** 2 + (others[k, 1] - dv) ** 2
        if away < close[0] * close[0] and abs(others[k, 2] - turn) < close[1]:
            return True
    return False


@kernel
def _score(grid: Array, u: Array, v: Array, du: int, dv: int, shift: int) -> float:
    """Sum of the scores of points at (u, v) + (du, dv) cells, in a grid of cells 2^shift times as wide."""
    total = 0.0
    for k in range(len(u)):
        i, j = (int(np.floor(u[k])) + du) >> shift, (int(np.floor(v[k])) + dv) >> shift
        if 0 <= i < grid.shape[0] and 0 <= j < grid.shape[1]:
            total += grid[i, j]
    return total


@kernel
def _place(points: Array, guess: Array, turn: float, u: Array, v: Array) -> None:
    """Points as they lie at a guess that is turned, in cells."""
    c, s = np.cos(guess[2] + turn), np.sin(guess[2] + turn)
    for k in range(len(points)):
        x, y = rotate(c, s, points[k, 0], points[k, 1])
        u[k], v[k] = guess[0] + x, guess[1] + y


@kernel
def _penalty(du: float, dv: float, turn: float, sigma: Array) -> float:
    """Half the squared Mahalanobis distance of a shift in cells and a turn."""
    return float((du / sigma[0]) ** 2 + (dv / sigma[1]) ** 2 + (turn / sigma[2]) ** 2) / 2
