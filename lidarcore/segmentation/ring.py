"""The ring of points: beams that returned, where they are connected, and how noisy they are."""

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import finite_kernel, inlined, kernel

_SIGMAS = 1.0  # of the difference of two ranges, allowed between neighbours on a wall seen at a grazing angle
_CLOSED = 4.0  # a ring is closed if the gap at its ends is less than so many beams
_GRAZING = 1 / np.sin(
    np.radians(6.0)
)  # walls seen at less than 6 degrees may fall apart [Borges and Aldon 2004]


@inlined
def compact(ranges: Array, points: Array, beams: Ints) -> int:
    """Keep the beams that returned; the number of points.

    points has the unit vectors of all beams in rows 1 and 2; afterwards rows rho, c, s of the points, packed.
    """
    n = 0
    for i in range(len(ranges)):
        points[0, n] = ranges[i]
        points[1, n] = points[1, i]
        points[2, n] = points[2, i]
        beams[n] = i
        n += (ranges[i] > 0) & (
            ranges[i] < np.inf
        )  # without a branch: the next beam overwrites one that did not
    return n


@inlined
def mean_increment(bearings: Array) -> float:
    """Mean angle (rad) between beams; over the whole turn where they go all the way around, wherever they start."""
    n = len(bearings)
    span = bearings[n - 1] - bearings[0]
    span = span if span > 0 else span + 2 * np.pi
    closed = (2 * np.pi - span) * (n - 1) < _CLOSED * span
    return 2 * np.pi / n if closed else span / max(n - 1, 1)


@kernel
def find_breaks(
    points: Array, n: int, gap: float, increment: float, v_rho: float, excess: Array, breaks: Ints
) -> int:
    """Write where point i is not connected to the one before it, around the ring, to breaks; their number.

    Two points may be as far apart as the gap, or as on a wall seen at a grazing angle (increment is the angle
    between beams, rad), and by what the noise of both ranges explains. excess (n,) is scratch; breaks has room
    for n + 1.
    """
    noise = _SIGMAS * np.sqrt(2 * v_rho)
    rho, c, s = points[0, :n], points[1, :n], points[2, :n]
    grazing = _GRAZING * increment
    excess[0] = _excess(rho[n - 1], c[n - 1], s[n - 1], rho[0], c[0], s[0], gap, grazing, noise)
    _excesses(rho, c, s, gap, grazing, noise, excess)
    count = 0
    for i in range(n):
        breaks[count] = i
        count += excess[i] > 0
    return count


@finite_kernel
def _excesses(
    rho: Array, c: Array, s: Array, gap: float, grazing: float, noise: float, excess: Array
) -> None:
    for i in range(1, len(rho)):
        excess[i] = _excess(rho[i - 1], c[i - 1], s[i - 1], rho[i], c[i], s[i], gap, grazing, noise)


@inlined
def _excess(
    rho_a: float, c_a: float, s_a: float, rho_b: float, c_b: float, s_b: float,
    gap: float, grazing: float, noise: float,
) -> float:  # fmt: skip
    """Squared distance between two points, less what is allowed."""
    dx, dy = rho_b * c_b - rho_a * c_a, rho_b * s_b - rho_a * s_a
    limit = max(gap, grazing * min(rho_a, rho_b) + noise)
    return dx * dx + dy * dy - limit * limit


@inlined
def unroll(points: Array, beams: Ints, n: int, start: int) -> None:
    """Repeat the points before `start` behind the last one: the ring is now start ... start + n without a seam."""
    for row in range(3):
        for i in range(start):
            points[row, n + i] = points[row, i]
    for i in range(start):
        beams[n + i] = beams[i]


@kernel
def noise_seen(rho: Array, curvature: Array) -> float:
    """Robust standard deviation (m) of the ranges: median distance of a range from the mean of its neighbours.

    On a smooth surface this is noise; jumps and corners are few. curvature (n,) is scratch. The median comes from
    counting below a bound that is bisected to within 3 percent, which vectorises.
    """
    n = len(rho)
    if n < 3:
        return 0.0
    for i in range(1, n - 1):
        curvature[i] = np.abs(rho[i] - 0.5 * (rho[i - 1] + rho[i + 1]))
    curvature[0] = np.abs(rho[0] - 0.5 * (rho[n - 1] + rho[1]))
    curvature[n - 1] = np.abs(rho[n - 1] - 0.5 * (rho[n - 2] + rho[0]))
    low, high = 1e-5, 10.0
    while high > 1.03 * low:
        middle = np.sqrt(low * high)
        below = 0
        for i in range(n):
            below += curvature[i] < middle
        if 2 * below < n:
            low = middle
        else:
            high = middle
    return low / (0.6745 * np.sqrt(1.5))  # a normal's median deviation; three ranges take part
