"""Branch and bound over all poses in a map [Hess et al. 2016; Olson 2009]: the best there is, not the best of some."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import inlined, kernel
from lidarcore.mapping.relocation.field import FULL, LEVELS, OCCUPIED, OPEN, Field

Bytes = NDArray[np.uint8]
Shorts = NDArray[np.int32]


class Turned(NamedTuple):
    """Cells (A, N) of N points at each of A angles, relative to the sensor."""

    columns: Shorts
    rows: Shorts


class Nodes(NamedTuple):
    """Squares of poses at one angle: level, angle, column and row (S, 4) of each, and how well it fits at most (S,)."""

    squares: Shorts
    bounds: Shorts


@kernel
def squares(
    field: Field, points: Turned, level: int, angles: Ints, box: tuple[int, int, int, int], least: int
) -> Nodes:
    """Squares of one size, at some of the angles, that may hold a pose of at least that fit, the best first.

    box: first column and row, and those behind the last.
    """
    side = 1 << level
    most = len(angles) * ((box[3] - box[1] + side - 1) // side) * ((box[2] - box[0] + side - 1) // side)
    nodes, bounds, n = np.empty((most, 4), np.int32), np.empty(most, np.int32), 0
    for row in range(box[1], box[3], side):
        for column in range(box[0], box[2], side):
            if field.room[level, row, column] == 0:
                continue
            for a in angles:
                bound = fit_at(field.levels[level], points.columns[a], points.rows[a], column, row, least)
                if bound >= least:
                    nodes[n, 0], nodes[n, 1], nodes[n, 2], nodes[n, 3] = level, a, column, row
                    bounds[n] = bound
                    n += 1
    order = np.argsort(-bounds[:n], kind="mergesort")
    return Nodes(nodes[order], bounds[order])


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
    field: Field, points: Turned, nodes: Nodes, least: int, taken: Shorts, apart: tuple[int, int]
) -> tuple[int, int, int, int]:
    """The pose of the best fit, at least that: fit, angle, column and row; -1 if there is none.

    Poses within `apart` (angles, cells) of those taken (T, 3) do not count. nodes are those of `squares`.
    """
    best, found = least - 1, (-1, 0, 0, 0)
    stack, children = _room_for(4 * LEVELS + 4), _room_for(4)
    for i in range(len(nodes.bounds)):
        if nodes.bounds[i] <= best:
            break
        stack.squares[0], stack.bounds[0], n = nodes.squares[i], nodes.bounds[i], 1
        while n > 0:
            n -= 1
            bound = stack.bounds[n]
            if bound <= best:
                continue
            level, a, column, row = stack.squares[n]
            if level == 0:
                if not _is_taken(taken, a, column, row, len(points.columns), apart):
                    best, found = bound, (bound, a, column, row)
                continue
            n += _branch(field, points, stack.squares[n].copy(), best + 1, children, stack, n)
    return found


@inlined
def _room_for(count: int) -> Nodes:
    return Nodes(np.empty((count, 4), np.int32), np.empty(count, np.int32))


@kernel
def _branch(
    field: Field, points: Turned, node: Shorts, least: int, children: Nodes, stack: Nodes, n: int
) -> int:
    """Put the quarters of a node that may hold that fit on the stack, the best on top. Returns how many."""
    level, half, count, room = node[0] - 1, 1 << (node[0] - 1), 0, field.room
    columns, rows = points.columns[node[1]], points.rows[node[1]]
    for quarter in range(4):
        column, row = node[2] + half * (quarter % 2), node[3] + half * (quarter // 2)
        if row >= room.shape[1] or column >= room.shape[2] or room[level, row, column] == 0:
            continue
        bound = fit_at(field.levels[level], columns, rows, column, row, least)
        if bound >= least:
            k = count
            while k > 0 and children.bounds[k - 1] > bound:
                children.bounds[k] = children.bounds[k - 1]
                children.squares[k] = children.squares[k - 1]
                k -= 1
            children.bounds[k], child = bound, children.squares[k]
            child[0], child[1], child[2], child[3] = level, node[1], column, row
            count += 1
    for k in range(count):
        stack.squares[n + k], stack.bounds[n + k] = children.squares[k], children.bounds[k]
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
def borne_out(field: Field, points: Array, origins: Array) -> float:
    """How well the points (N, 2) fit, in cells: 0 to 1. One whose ray the map contradicts does not."""
    total = 0
    for k in range(len(points)):
        column, row = int(np.floor(points[k, 0])), int(np.floor(points[k, 1]))
        is_inside = 0 <= row < field.states.shape[0] and 0 <= column < field.states.shape[1]
        if is_inside and not _is_contradicted(field.states, points[k], origins[k]):
            total += field.levels[0, row, column]
    return total / FULL / max(len(points), 1)


@kernel
def contradicted(states: Bytes, points: Array, origins: Array) -> float:
    """Share of rays, from origins to points (N, 2) in cells, that the map contradicts."""
    wrong = 0
    for k in range(len(points)):
        wrong += _is_contradicted(states, points[k], origins[k])
    return wrong / max(len(points), 1)


@kernel
def _is_contradicted(states: Bytes, point: Array, origin: Array) -> bool:
    """Whether a ray goes through something occupied and on into the open, or ends in the open.

    One that only grazes the wall on which it ends is not contradicted.
    """
    if _state(states, point[0], point[1]) == OPEN:
        return True
    dx, dy = point[0] - origin[0], point[1] - origin[1]
    steps, is_through = int(np.hypot(dx, dy)) + 1, False
    for step in range(steps):
        state = _state(states, origin[0] + dx * step / steps, origin[1] + dy * step / steps)
        is_through |= state == OCCUPIED
        if is_through and state == OPEN:
            return True
    return False


@kernel
def _state(states: Bytes, x: float, y: float) -> int:
    column, row = int(np.floor(x)), int(np.floor(y))
    if 0 <= row < states.shape[0] and 0 <= column < states.shape[1]:
        return int(states[row, column])
    return 0
