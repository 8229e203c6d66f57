"""What one scan says about the cells that its rays go through [Moravec & Elfes 1985; Hornung et al. 2013]."""

import numpy as np
from numpy.typing import NDArray

from lidarcore.arrays import Array
from lidarcore.compiled import kernel

Bytes = NDArray[np.int8]
Marks = NDArray[np.uint8]
Evidence = tuple[int, int, int, int, int]
"""Steps of log-odds: what a hit adds, what a miss takes, and a miss beside a hit; the bounds above and below."""


@kernel
def mark_scan(odds: Bytes, marks: Marks, mark: int, ends: Array, start: Array, evidence: Evidence) -> None:
    """Add a scan to log-odds (H, W): its rays go from a start (2,) to ends (N, 2), in cells from the first one on.

    A cell is changed once by a scan, however many rays meet it, and a hit outweighs rays that pass: rays that graze
    a wall go through its cells. Beside a hit a miss counts little, for the pose is not known to a cell.
    marks (H, W) of other scans must differ from this one's mark and the next number.
    """
    hit, miss, little, most, least = evidence
    for i in range(len(ends)):
        column, row = int(np.floor(ends[i, 0])), int(np.floor(ends[i, 1]))
        for beside in marks[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]:
            for k in range(len(beside)):
                if beside[k] != mark:
                    beside[k] = mark + 1
        if marks[row, column] != mark:
            marks[row, column] = mark
            odds[row, column] = min(odds[row, column] + hit, most)
    for i in range(len(ends)):
        _look_through(odds, marks, mark, ends[i], start, (miss, little, least))


@kernel
def _look_through(
    odds: Bytes, marks: Marks, mark: int, end: Array, start: Array, evidence: tuple[int, int, int]
) -> None:
    """Take from every cell between a start and the cell of an end [Amanatides & Woo 1987]."""
    miss, little, least = evidence
    x, y = start[0], start[1]
    column, row = int(np.floor(x)), int(np.floor(y))
    dx, dy = end[0] - x, end[1] - y
    right, up = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    across = abs(1 / dx) if dx != 0 else np.inf
    along = abs(1 / dy) if dy != 0 else np.inf
    next_x = across * (column + 1 - x if dx > 0 else x - column) if dx != 0 else np.inf
    next_y = along * (row + 1 - y if dy > 0 else y - row) if dy != 0 else np.inf
    for _ in range(abs(int(np.floor(end[0])) - column) + abs(int(np.floor(end[1])) - row)):
        if marks[row, column] != mark:
            taken = little if marks[row, column] == mark + 1 else miss
            odds[row, column] = max(odds[row, column] - taken, least)
            marks[row, column] = mark
        if next_x < next_y:
            next_x += across
            column += right
        else:
            next_y += along
            row += up
