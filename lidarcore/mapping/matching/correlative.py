"""Correlative scan matching: the best pose in a window, wherever the guess lies in it [Olson, ICRA 2009].

The reference is a grid of scores. Blocks of shifts are judged at once on a grid of the largest scores around, which
never underrates them, and only blocks that may hold the best shift are looked into.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array, Ints, Singles
from lidarcore.compiled import kernel
from lidarcore.geometry import wrap
from lidarcore.geometry.kernels import rotate
from lidarcore.mapping.matching.scores import BLOCK, largest_ahead, score_grid, sum_blocks, sum_scores
from lidarcore.mapping.settings import MatchSettings

_CLOSE, _CLOSE_TURN = 0.5, 0.25  # m and rad within which two poses are one
_WIDE = 1.0  # m to either side from which on a window is searched in cells of twice the size
_ENOUGH = 120  # points that tell one pose from another; more cost time only
_REACH = 3  # standard deviations of the guess, to which it is searched

_NO_POSES = np.empty((0, 3))


class _Window(NamedTuple):
    """What poses are tried, around a guess, and which of them do not count; shifts and places in cells.

    guess   (3,)
    half    (2,) blocks to either side
    turns   (T,) rad
    sigma   (3,) standard deviations of the guess
    close   (2,) cells and rad within which two poses are one
    """

    guess: Array
    half: Ints
    turns: Array
    sigma: Array
    close: Array


def search(reference: Array, points: Array, guess: Array, sigma: Array, settings: MatchSettings) -> Array:
    """T_reference_sensor (3,) at which points (N, 2) m fit the reference points (M, 2) m best.

    Looks three standard deviations sigma (3,) around the guess (3,), up to the settings' limits; where several
    poses fit alike (along a corridor), the one nearest to the guess wins. The guess itself if no point is near.
    """
    return next(candidates(reference, points, guess, sigma, settings))


def candidates(
    reference: Array,
    points: Array,
    guess: Array,
    sigma: Array,
    settings: MatchSettings,
    besides: Array = _NO_POSES,
    least: float = -np.inf,
) -> Iterator[Array]:
    """The best pose (3,) that `search` finds, then the best one that is not close to it, and so on.

    None is close to a pose of `besides` (E, 3) either: what else might it be? They end where none is left of which more
    than a share `least` of the points fits, less what it costs to contradict the guess.
    """
    most = np.minimum(_REACH * sigma, [settings.max_shift, settings.max_shift, settings.max_turn])
    cell = settings.cell * (2 if most[:2].max() > _WIDE else 1)
    if not len(points):
        yield guess
        return
    ranges = np.hypot(*points.T)
    horizon = max(settings.horizon, _middle(ranges))
    near = points[ranges <= horizon]
    near = near[:: max(1, len(near) // _ENOUGH)]
    kept = reference[np.hypot(*(reference - guess[:2]).T) < horizon + most[:2].max()]
    if not len(kept):
        yield guess
        return
    low, fine = score_grid(kept, cell, max(settings.blur, cell))
    step = cell / max(1.0, arm(near))  # rad that move far points by one cell
    turns = step * np.arange(-np.floor(most[2] / step), np.floor(most[2] / step) + 1)
    half = np.ceil(most[:2] / cell / BLOCK).astype(np.int64)
    unit = np.array([cell, cell, 1.0])
    centre = np.array([*(guess[:2] - low) / cell, guess[2]])
    window = _Window(centre, half, turns, sigma / unit, np.array([_CLOSE / cell, _CLOSE_TURN]))
    cells, ahead = _cells(near / cell, window), largest_ahead(fine)
    bounds, fewest = _bounds(ahead, cells, window), least * len(near)
    known, worth = bounds.copy(), np.flatnonzero(bounds > fewest)
    order = worth[np.argsort(-bounds.ravel()[worth])]
    while True:
        others = (besides - guess) / unit
        others[:, 2] = wrap(others[:, 2])
        total, *shift = _search(fine, ahead, cells, bounds, known, order, others, window, fewest)
        if total <= fewest:
            return
        found: Array = guess + np.array(shift) * unit
        yield found
        besides = np.concatenate([besides, found[None]])


@kernel
def _middle(ranges: Array) -> float:
    """Their median; numpy, outside of kernels, takes several times as long."""
    return float(np.median(ranges))


@kernel
def arm(points: Array) -> float:
    """Distance in m by which turning moves the points (N, 2), N > 0: four fifths of them are nearer."""
    return float(np.percentile(np.hypot(points[:, 0], points[:, 1]), 80))


@kernel
def _search(
    fine: Singles,
    ahead: Singles,
    cells: Ints,
    bounds: Array,
    known: Array,
    order: Ints,
    others: Array,
    window: _Window,
    least: float,
) -> tuple[float, float, float, float]:
    """Largest score above `least`, and its shift, in cells, and turn, not close to one of others (E, 3); else `least`.

    Looks into blocks in the order given, which are known better than by their bounds afterwards.
    """
    turns, half, scores = window.turns, window.half, np.empty((BLOCK, BLOCK), np.float32)
    flat, limits = bounds.ravel(), known.ravel()
    best, best_u, best_v, best_turn = least, 0, 0, 0.0
    for n in order:
        if flat[n] <= best:
            break
        if limits[n] <= best:
            continue
        t, block = divmod(n, bounds.shape[1] * bounds.shape[2])
        a, b = divmod(block, bounds.shape[2])
        u, v = (a - half[0]) * BLOCK, (b - half[1]) * BLOCK
        limits[n] = sum_scores(fine, ahead, cells[t], u, v, flat[n], best, scores)
        if limits[n] <= best:
            continue
        limits[n] = -np.inf
        for du in range(u, u + BLOCK):
            for dv in range(v, v + BLOCK):
                total = scores[du - u, dv - v] - _penalty(du, dv, turns[t], window.sigma)
                limits[n] = max(limits[n], total)
                if total > best and not _is_close(others, window.close, du, dv, turns[t]):
                    best, best_u, best_v, best_turn = total, du, dv, turns[t]
    return best, best_u, best_v, best_turn


@kernel
def _cells(points: Array, window: _Window) -> Ints:
    """(T, N, 2) cells in which the points lie at the guess, for each turn."""
    cells, guess = np.empty((len(window.turns), len(points), 2), np.int64), window.guess
    for t in range(len(window.turns)):
        c, s = np.cos(guess[2] + window.turns[t]), np.sin(guess[2] + window.turns[t])
        for k in range(len(points)):
            x, y = rotate(c, s, points[k, 0], points[k, 1])
            cells[t, k, 0], cells[t, k, 1] = np.floor(guess[0] + x), np.floor(guess[1] + y)
    return cells


@kernel
def _bounds(ahead: Singles, cells: Ints, window: _Window) -> Array:
    """(T, A, B) what no shift in a block of shifts exceeds, for each turn and block."""
    turns, half = window.turns, window.half
    A, B = 2 * half[0] + 1, 2 * half[1] + 1
    sums = np.empty((len(turns), A, (B + BLOCK - 1) // BLOCK * BLOCK), np.float32)
    sum_blocks(ahead, cells, half, sums)
    bounds = np.empty((len(turns), A, B))
    for t in range(len(turns)):
        for a in range(A):
            for b in range(B):
                u, v = (a - half[0]) * BLOCK, (b - half[1]) * BLOCK
                bounds[t, a, b] = sums[t, a, b] - _least_penalty(u, v, turns[t], window.sigma)
    return bounds


@kernel
def _is_close(others: Array, close: Array, du: float, dv: float, turn: float) -> bool:
    """True if a shift in cells and a turn are those of another pose."""
    for k in range(len(others)):
        away = (others[k, 0] - du) ** 2 + (others[k, 1] - dv) ** 2
        if away < close[0] * close[0] and abs(others[k, 2] - turn) < close[1]:
            return True
    return False


@kernel
def _least_penalty(u: int, v: int, turn: float, sigma: Array) -> float:
    """Of the shifts in the block from (u, v) on: that of the one nearest to the guess."""
    return _penalty(min(max(u, 0), u + BLOCK - 1), min(max(v, 0), v + BLOCK - 1), turn, sigma)


@kernel
def _penalty(du: float, dv: float, turn: float, sigma: Array) -> float:
    """Half the squared Mahalanobis distance of a shift in cells and a turn."""
    return float((du / sigma[0]) ** 2 + (dv / sigma[1]) ** 2 + (turn / sigma[2]) ** 2) / 2
