"""Branch and bound over all poses in a map [Hess et al. 2016; Olson 2009]: the best there is, not the best of some."""

import numpy as np
from numpy.typing import NDArray

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import kernel
from lidarcore.mapping.relocation.field import FULL, LEVELS, OCCUPIED, OPEN

Bytes = NDArray[np.uint8]
Shorts = NDArray[np.int32]


@kernel
def squares(
    levels: Bytes,
    room: Bytes,
    columns: Shorts,
    rows: Shorts,
    level: int,
    angles: Ints,
    box: tuple[int, int, int, int],
    least: int,
) -> tuple[Shorts, Shorts]:
    """Squares of one size, at some of the angles, that may hold a pose of at least that fit: nodes, and their bounds.

    columns, rows (A, N): cells of the points at each of A angles, relative to the sensor. box: first column and row,
    and those behind the last. A node is (level, angle, column, row).
    """
    side = 1 << level
    most = len(angles) * ((box[3] - box[1] + side - 1) // side) * ((box[2] - box[0] + side - 1) // side)
    nodes, bounds, n = np.empty((most, 4), np.int32), np.empty(most, np.int32), 0
    for row in range(box[1], box[3], side):
        for column in range(box[0], box[2], side):
            if room[level, row, column] == 0:
                continue
            for a in angles:
                bound = fit_at(levels[level], columns[a], rows[a], column, row, least)
                if bound >= least:
                    nodes[n, 0], nodes[n, 1], nodes[n, 2], nodes[n, 3] = level, a, column, row
                    bounds[n] = bound
                    n += 1
    return nodes[:n], bounds[:n]


@kernel
def fit_at(level: Bytes, columns: Shorts, rows: Shorts, column: int, row: int, least: int) -> int:
    """Sum of the fits of the points with the sensor at a cell; -1 as soon as it cannot reach the least."""
    total, short = 0, FULL * len(columns) - least
    for k in range(len(columns)):
        x, y = column + columns[k], row + rows[k]
        fit = level[y, x] if 0 <= y < level.shape[0] and 0 <= x < level.shape[1] else 0
        total += fit
        short -= FULL - fit
        if short < 0:
            return -1
    return int(total)


@kernel
def best_pose(
    levels: Bytes,
    room: Bytes,
    columns: Shorts,
    rows: Shorts,
    nodes: Shorts,
    bounds: Shorts,
    order: Ints,
    least: int,
    taken: Shorts,
    apart: tuple[int, int],
) -> tuple[int, int, int, int]:
    """The pose of the best fit, at least that: fit, angle, column and row; -1 if there is none.

    Poses within `apart` (angles, cells) of those taken (T, 3) do not count. nodes are those of `squares`, the best
    first by `order`.
    """
    best, found = least - 1, (-1, 0, 0, 0)
    stack, stacked = np.empty((4 * LEVELS + 4, 4), np.int32), np.empty(4 * LEVELS + 4, np.int32)
    children, marks = np.empty((4, 4), np.int32), np.empty(4, np.int32)
    for i in order:
        if bounds[i] <= best:
            break
        stack[0], stacked[0], n = nodes[i], bounds[i], 1
        while n > 0:
            n -= 1
            bound = stacked[n]
            if bound <= best:
                continue
            level, a, column, row = stack[n]
            if level == 0:
                if not _is_taken(taken, a, column, row, len(columns), apart):
                    best, found = bound, (bound, a, column, row)
                continue
            n += _branch(
                levels,
                room,
                columns[a],
                rows[a],
                stack[n].copy(),
                best + 1,
                children,
                marks,
                stack,
                stacked,
                n,
            )
    return found


@kernel
def _branch(
    levels: Bytes,
    room: Bytes,
    columns: Shorts,
    rows: Shorts,
    node: Shorts,
    least: int,
    children: Shorts,
    marks: Shorts,
    stack: Shorts,
    stacked: Shorts,
    n: int,
) -> int:
    """Put the quarters of a node that may hold that fit on the stack, the best on top. Returns how many."""
    level, half, count = node[0] - 1, 1 << (node[0] - 1), 0
    for quarter in range(4):
        column, row = node[2] + half * (quarter % 2), node[3] + half * (quarter // 2)
        if row >= room.shape[1] or column >= room.shape[2] or room[level, row, column] == 0:
            continue
        bound = fit_at(levels[level], columns, rows, column, row, least)
        if bound >= least:
            k = count
            while k > 0 and marks[k - 1] > bound:
                marks[k] = marks[k - 1]
                children[k] = children[k - 1]
                k -= 1
            marks[k] = bound
            children[k, 0], children[k, 1], children[k, 2], children[k, 3] = level, node[1], column, row
            count += 1
    for k in range(count):
        stack[n + k], stacked[n + k] = children[k], marks[k]
    return count


@kernel
def _is_taken(taken: Shorts, a: int, column: int, row: int, angles: int, apart: tuple[int, int]) -> bool:
    for k in range(len(taken)):
        turn = abs(a - taken[k, 0])
        dx, dy = column - taken[k, 1], row - taken[k, 2]
        if min(turn, angles - turn) <= apart[0] and dx * dx + dy * dy <= apart[1] * apart[1]:
            return True
    return False


@kernel
def contradicted(states: Bytes, points: Array, origins: Array) -> float:
    """Share of rays, from origins to points (N, 2) in cells, that the map contradicts.

    A ray is contradicted if it goes through something occupied and on into the open, or ends in the open. One that only
    grazes the wall on which it ends is not.
    """
    wrong = 0
    for k in range(len(points)):
        dx, dy = points[k, 0] - origins[k, 0], points[k, 1] - origins[k, 1]
        steps = int(np.hypot(dx, dy)) + 1
        bad = _state(states, points[k, 0], points[k, 1]) == OPEN
        is_through = False
        for step in range(steps):
            state = _state(states, origins[k, 0] + dx * step / steps, origins[k, 1] + dy * step / steps)
            is_through |= state == OCCUPIED
            if is_through and state == OPEN:
                bad = True
                break
        wrong += bad
    return wrong / max(len(points), 1)


@kernel
def _state(states: Bytes, x: float, y: float) -> int:
    column, row = int(np.floor(x)), int(np.floor(y))
    if 0 <= row < states.shape[0] and 0 <= column < states.shape[1]:
        return int(states[row, column])
    return 0
