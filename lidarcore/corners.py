"""Corners: where two neighbouring walls meet ([CWLF 36-48], [WCTLS 24-25])."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import inlined
from lidarcore.tables import (
    CORNER_CONSISTENT,
    CORNER_MAP,
    CORNER_PUBLISHED,
    DISTANCE,
    END,
    END_SPACING,
    FIRST_BEAM,
    LAST_BEAM,
    LINE_CONSISTENT,
    LINE_MAP,
    LINE_PUBLISHED,
    NORMAL,
    SEGMENTS,
    SINE,
    START,
    START_SPACING,
    TOO_FAR,
    TOO_FLAT,
    reject,
)

_SIGMAS = 3.0


@inlined
def find_corners(
    segments: Array,
    n_segments: int,
    sin_angle: float,
    corner_gap: float,
    corners: Array,
    rejections: Array,
    n_rejections: int,
) -> tuple[int, int]:
    """Intersect each segment with the next around the ring; the numbers of corners and of rejections.

    They make a corner if the angle is large enough and the facing ends are within corner_gap of the
    intersection, beyond the spacing of the points at that end (a wall seen at a grazing angle ends early)
    and what the intersection may be off from the true one.
    """
    n_corners = 0
    for j in range(n_segments if n_segments > 2 else n_segments - 1):
        k = (j + 1) % n_segments
        first, second, row = segments[j], segments[k], corners[n_corners]
        sine = np.abs(first[NORMAL] * second[NORMAL + 1] - first[NORMAL + 1] * second[NORMAL])
        if sine < sin_angle:
            reject(
                rejections[n_rejections], TOO_FLAT, first[LAST_BEAM], second[FIRST_BEAM],
                (first[END] + second[START]) / 2, (first[END + 1] + second[START + 1]) / 2, sine, sin_angle,
            )  # fmt: skip
            n_rejections += 1
            continue
        intersect(first, second, row)
        beyond = max(
            _distance(row, first, END) - first[END_SPACING],
            _distance(row, second, START) - second[START_SPACING],
        ) - _SIGMAS * np.sqrt(row[CORNER_MAP] + row[CORNER_MAP + 3])  # fmt: skip
        if beyond > corner_gap:
            reject(
                rejections[n_rejections], TOO_FAR, first[LAST_BEAM], second[FIRST_BEAM],
                row[0], row[1], beyond, corner_gap,
            )  # fmt: skip
            n_rejections += 1
            continue
        row[SEGMENTS], row[SEGMENTS + 1], row[SINE] = j, k, sine
        n_corners += 1
    return n_corners, n_rejections


@inlined
def _distance(corner: Array, segment: Array, end: int) -> float:
    """Distance (m) of a corner from one end of a segment."""
    return np.sqrt((corner[0] - segment[end]) ** 2 + (corner[1] - segment[end + 1]) ** 2)


@inlined
def intersect(first: Array, second: Array, out: Array) -> None:
    """Intersect two lines given as rows unit normal (2), r, published (4), consistent (4), for maps (4).

    Writes x, y and the three covariances (CORNER_FIELDS numbers) to out. One code path for every fitter: to first order
    the result does not depend on the parameters a line was fitted in.
    """
    cj, sj, ck, sk = first[NORMAL], first[NORMAL + 1], second[NORMAL], second[NORMAL + 1]
    d = sk * cj - ck * sj
    rj, rk = first[DISTANCE], second[DISTANCE]
    x, y = (rj * sk - rk * sj) / d, (rk * cj - rj * ck) / d
    out[0], out[1] = x, y
    # n_j . p = r_j gives n_j . dp = dr_j - (t_j . p) dalpha_j =: e_j; dp follows from e as p from r.
    tj, tk = cj * y - sj * x, ck * y - sk * x
    for i, o in (
        (LINE_PUBLISHED, CORNER_PUBLISHED),
        (LINE_CONSISTENT, CORNER_CONSISTENT),
        (LINE_MAP, CORNER_MAP),
    ):
        vj = first[i + 3] - 2 * tj * first[i + 1] + tj * tj * first[i]
        vk = second[i + 3] - 2 * tk * second[i + 1] + tk * tk * second[i]
        out[o] = (sk * sk * vj + sj * sj * vk) / (d * d)
        out[o + 1] = out[o + 2] = -(sk * ck * vj + sj * cj * vk) / (d * d)
        out[o + 3] = (ck * ck * vj + cj * cj * vk) / (d * d)
