"""Pieces to wall segments: each fitted by the chosen method, or rejected with the reason."""

from typing import NamedTuple

import numpy as np

from lidarcore.compiled import inlined
from lidarcore.lines import fit_piece
from lidarcore.lines.regression import OK
from lidarcore.noise import NoiseModel
from lidarcore.scan import Array
from lidarcore.segmentation import Pieces, Ring
from lidarcore.tables import (
    DEGENERATE,
    DISTANCE,
    END,
    END_SPACING,
    FIRST_BEAM,
    LAST_BEAM,
    N_POINTS,
    NORMAL,
    RMS,
    START,
    START_SPACING,
    TOO_FEW_POINTS,
    TOO_SHORT,
    reject,
)

_TRIM_FROM = 8  # pieces with fewer points keep their end points


class Least(NamedTuple):
    """What a piece must have to be a wall: points, and length in m."""

    points: float
    length: float


@inlined
def fit_pieces(
    ring: Ring,
    pieces: Pieces,
    fitter: int,
    noise: NoiseModel,
    least: Least,
    work: Array,
    segments: Array,
    rejections: Array,
) -> tuple[int, int]:
    """Write a row for each accepted segment and each rejected piece; their numbers. work is scratch."""
    points, beams = ring.points, ring.beams
    n_segments = n_rejections = 0
    for p in range(len(pieces.first)):
        a, b = pieces.first[p], pieces.last[p]
        row = segments[n_segments]
        row[FIRST_BEAM], row[LAST_BEAM], row[N_POINTS] = beams[a], beams[b], b - a + 1
        middle = (a + b) // 2
        x, y = points[0, middle] * points[1, middle], points[0, middle] * points[2, middle]
        reason, value, limit = -1, 0.0, 0.0
        if row[N_POINTS] < least.points:
            reason, value, limit = TOO_FEW_POINTS, row[N_POINTS], least.points
        else:
            # The end points may belong to a neighbour or to both (mixed pixels): they do not take part in the fit.
            trim = 1 if row[N_POINTS] >= _TRIM_FROM else 0
            inside = slice(a + trim, b + 1 - trim)
            rho, c, s = points[0, inside], points[1, inside], points[2, inside]
            free = (_free(pieces, p - 1, least.points), _free(pieces, p, least.points))
            status = fit_piece(
                fitter, rho, c, s, noise, (work[0, inside], work[1, inside], work[2, inside]), free, row
            )
            if status != OK:
                reason, value = DEGENERATE, status
            else:
                length = _measure_extent(points, a, b, trim, row)
                if length < least.length:
                    reason, value, limit = TOO_SHORT, length, least.length
        if reason < 0:
            n_segments += 1
        else:
            reject(rejections[n_rejections], reason, beams[a], beams[b], x, y, value, limit)
            n_rejections += 1
    return n_segments, n_rejections


@inlined
def _free(pieces: Pieces, p: int, points: float) -> bool:
    """Whether no wall follows piece p in its run of points: neither is told by the other where it ends."""
    if p < 0 or p + 1 >= len(pieces.first) or pieces.run[p] != pieces.run[p + 1]:
        return True
    return min(pieces.last[p] - pieces.first[p], pieces.last[p + 1] - pieces.first[p + 1]) + 1 < points


@inlined
def _measure_extent(points: Array, a: int, b: int, trim: int, row: Array) -> float:
    """End points on the line, spacing of the points at both ends and residual, into the row; the length."""
    nx, ny, r = row[NORMAL], row[NORMAL + 1], row[DISTANCE]
    inside = slice(a + trim, b + 1 - trim)
    row[RMS] = _rms(points[0, inside], points[1, inside], points[2, inside], nx, ny, r)
    start, end = _along(points, a, nx, ny), _along(points, b, nx, ny)
    row[START], row[START + 1] = r * nx - start * ny, r * ny + start * nx
    row[END], row[END + 1] = r * nx - end * ny, r * ny + end * nx
    row[START_SPACING] = np.abs(_along(points, a + 1, nx, ny) - start)
    row[END_SPACING] = np.abs(_along(points, b - 1, nx, ny) - end)
    return np.abs(end - start)


@inlined
def _along(points: Array, i: int, nx: float, ny: float) -> float:
    """Coordinate of a point along the line."""
    return points[0, i] * (nx * points[2, i] - ny * points[1, i])


@inlined
def _rms(rho: Array, c: Array, s: Array, nx: float, ny: float, r: float) -> float:
    squares = 0.0
    for i in range(len(rho)):
        e = rho[i] * (nx * c[i] + ny * s[i]) - r
        squares += e * e
    return np.sqrt(squares / len(rho))
