"""The columns of the table that kernels write and `Features` reads: rows of segments, of corners, of rejections."""

from lidarcore.arrays import Array
from lidarcore.compiled import inlined
from lidarcore.lines.regression import (
    DISTANCE,
    LINE_CONSISTENT,
    LINE_FIELDS,
    LINE_MAP,
    LINE_PUBLISHED,
    NORMAL,
)

__all__ = ["DISTANCE", "LINE_CONSISTENT", "LINE_FIELDS", "LINE_MAP", "LINE_PUBLISHED", "NORMAL"]

# A segment begins with its line.
START, END = LINE_FIELDS, LINE_FIELDS + 2
START_SPACING, END_SPACING = LINE_FIELDS + 4, LINE_FIELDS + 5
FIRST_BEAM, LAST_BEAM, N_POINTS, RMS = LINE_FIELDS + 6, LINE_FIELDS + 7, LINE_FIELDS + 8, LINE_FIELDS + 9
FIELDS = LINE_FIELDS + 10

# A corner: x, y, published (4), consistent (4), for maps (4), the two segments, the sine of the angle between them.
CORNER_PUBLISHED, CORNER_CONSISTENT, CORNER_MAP, CORNER_FIELDS = 2, 6, 10, 14
SEGMENTS, SINE = CORNER_FIELDS, CORNER_FIELDS + 2

# A rejection: why, first and last beam, x, y, the value found, the limit it missed.
REASON, REJECTED_BEAMS, REJECTED_XY, VALUE, LIMIT = 0, 1, 3, 5, 6
TOO_FEW_POINTS, TOO_SHORT, DEGENERATE, TOO_FLAT, TOO_FAR = range(5)


@inlined
def reject(
    row: Array,
    reason: int,
    first_beam: float,
    last_beam: float,
    x: float,
    y: float,
    value: float,
    limit: float,
) -> None:
    """Write one rejection."""
    row[REASON], row[VALUE], row[LIMIT] = reason, value, limit
    row[REJECTED_BEAMS], row[REJECTED_BEAMS + 1] = first_beam, last_beam
    row[REJECTED_XY], row[REJECTED_XY + 1] = x, y
