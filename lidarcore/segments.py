"""From a ring of beams to pieces, one for each wall: iterative end point fit, merged back and tidied (MATH 5).

Points are packed (missing returns left out) and the ring is unrolled from a break, so that every piece is a slice.
Pieces are inclusive ranges [first, last] of points.
"""

import numpy as np
from numpy.typing import NDArray

from lidarcore.compiled import finite_kernel, inlined, kernel
from lidarcore.scan import Array

Ints = NDArray[np.int64]

_GRAZING = 1 / np.sin(
    np.radians(6.0)
)  # walls seen at less than 6 degrees may fall apart [Borges and Aldon 2004]
_SPLIT_SIGMAS = 3.0
_MERGE_CHI2 = (
    20.0  # about the 0.9999 quantile for two or three degrees of freedom: splits are chosen, not random
)
_NOISE_SAMPLES = 256  # ranges that the estimate of the noise looks at
SUMS = 9  # what is kept of a piece: see `sums`; the last is its chi-square
_REFINE_REACH = 12  # points looked at on each side of a common end


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


@kernel
def find_breaks(points: Array, n: int, gap: float, increment: float, excess: Array, breaks: Ints) -> int:
    """Write where point i is not connected to the one before it, around the ring, to breaks; their number.

    excess (n,) is scratch; breaks has room for n + 1.
    """
    rho, c, s = points[0, :n], points[1, :n], points[2, :n]
    grazing = _GRAZING * increment
    excess[0] = _excess(rho[n - 1], c[n - 1], s[n - 1], rho[0], c[0], s[0], gap, grazing)
    _excesses(rho, c, s, gap, grazing, excess)
    count = 0
    for i in range(n):
        breaks[count] = i
        count += excess[i] > 0
    return count


@finite_kernel
def _excesses(rho: Array, c: Array, s: Array, gap: float, grazing: float, excess: Array) -> None:
    for i in range(1, len(rho)):
        excess[i] = _excess(rho[i - 1], c[i - 1], s[i - 1], rho[i], c[i], s[i], gap, grazing)


@inlined
def _excess(
    rho_a: float, c_a: float, s_a: float, rho_b: float, c_b: float, s_b: float, gap: float, grazing: float
) -> float:
    """Squared distance between two points, less what is allowed: the gap, or more on a wall seen grazingly."""
    dx, dy = rho_b * c_b - rho_a * c_a, rho_b * s_b - rho_a * s_a
    limit = max(gap, grazing * min(rho_a, rho_b))
    return dx * dx + dy * dy - limit * limit


@kernel
def noise_seen(rho: Array, curvature: Array) -> float:
    """Robust standard deviation (m) of the ranges: median distance of a range from the mean of its neighbours.

    On a smooth surface this is noise; jumps and corners are few. curvature (n,) is scratch. The median comes from
    counting below a bound that is bisected to within 3 percent, which vectorises.
    """
    step = max(1, len(rho) // _NOISE_SAMPLES)
    n = (len(rho) - 2) // step
    if n < 1:
        return 0.0
    for i in range(n):
        k = i * step
        curvature[i] = np.abs(rho[k + 1] - 0.5 * (rho[k] + rho[k + 2]))
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


@inlined
def unroll(points: Array, beams: Ints, n: int, start: int) -> None:
    """Repeat the points before `start` behind the last one: the ring is now start ... start + n without a seam."""
    for row in range(3):
        for i in range(start):
            points[row, n + i] = points[row, i]
    for i in range(start):
        beams[n + i] = beams[i]


@finite_kernel
def farthest_from_chord(
    rho: Array, c: Array, s: Array, distance: Array, nx: float, ny: float, r: float
) -> tuple[int, float]:
    """Index and distance of the point farthest from the line nx x + ny y = r; distance (N,) is scratch."""
    largest = 0.0
    for i in range(len(rho)):
        distance[i] = np.abs(rho[i] * (nx * c[i] + ny * s[i]) - r)
        largest = max(largest, distance[i])
    for i in range(len(rho)):
        if distance[i] == largest:
            return i, largest
    return 0, largest


@inlined
def chord(rho: Array, c: Array, s: Array, first: int, last: int) -> tuple[float, float, float]:
    """Unit normal and signed distance of the line through two points (the normal is 0 if they coincide)."""
    x, y = rho[first] * c[first], rho[first] * s[first]
    dx, dy = rho[last] * c[last] - x, rho[last] * s[last] - y
    length = np.sqrt(dx * dx + dy * dy)
    if length == 0:
        return 0.0, 0.0, 0.0
    nx, ny = -dy / length, dx / length
    return nx, ny, nx * x + ny * y


@kernel
def split(
    points: Array,
    first: int,
    last: int,
    threshold: float,
    v_rho: float,
    v_theta: float,
    distance: Array,
    stack: Ints,
    ends: Ints,
) -> int:
    """Iterative end point fit of one run: the last point of each piece into ends, in order; their number.

    A piece is split where a point is farther from its chord than the threshold and than the noise explains.
    """
    rho, c, s = points[0], points[1], points[2]
    stack[0] = last
    depth, n_ends = 1, 0
    while depth > 0:
        last = stack[depth - 1]
        if last - first > 1:
            nx, ny, r = chord(rho, c, s, first, last)
            inner = slice(first + 1, last)
            k, largest = farthest_from_chord(rho[inner], c[inner], s[inner], distance[inner], nx, ny, r)
            k += first + 1
            across, along = nx * c[k] + ny * s[k], rho[k] * (nx * s[k] - ny * c[k])
            v = v_rho * across * across + v_theta * along * along
            if largest > threshold and largest * largest > _SPLIT_SIGMAS * _SPLIT_SIGMAS * 1.5 * v:
                stack[depth] = k
                depth += 1
                continue
        ends[n_ends] = last
        n_ends += 1
        first = last
        depth -= 1
    return n_ends


@inlined
def sums(rho: Array, c: Array, s: Array, out: Array) -> None:
    """Number, mean x, mean y, centred S_xx, S_xy, S_yy per point, mean c², mean c s of a piece, into out."""
    middle = len(rho) // 2
    x0, y0 = rho[middle] * c[middle], rho[middle] * s[middle]
    x_sum = y_sum = xx = xy = yy = cc = cs = 0.0
    for i in range(len(rho)):
        x, y = rho[i] * c[i] - x0, rho[i] * s[i] - y0
        x_sum += x
        y_sum += y
        xx += x * x
        xy += x * y
        yy += y * y
        cc += c[i] * c[i]
        cs += c[i] * s[i]
    n = len(rho)
    x, y = x_sum / n, y_sum / n
    out[0], out[1], out[2] = n, x + x0, y + y0
    out[3], out[4], out[5] = xx / n - x * x, xy / n - x * y, yy / n - y * y
    out[6], out[7] = cc / n, cs / n


@inlined
def join(a: Array, b: Array, out: Array) -> None:
    """Sums of two pieces together."""
    n = a[0] + b[0]
    p, q = a[0] / n, b[0] / n
    dx, dy = b[1] - a[1], b[2] - a[2]
    out[0] = n
    for k in range(1, 8):
        out[k] = p * a[k] + q * b[k]
    out[3] += p * q * dx * dx
    out[4] += p * q * dx * dy
    out[5] += p * q * dy * dy


@inlined
def line_of(m: Array) -> tuple[float, float, float, float]:
    """Unit normal, signed distance and mean squared residual of the best line through a piece with sums m."""
    half, dev = (m[3] + m[5]) / 2, (m[3] - m[5]) / 2
    root = np.sqrt(dev * dev + m[4] * m[4])
    # Eigenvector of the smaller eigenvalue half - root, from the row that does not cancel.
    nx, ny = (m[4], -dev - root) if dev > 0 else (dev - root, m[4])
    length = np.sqrt(nx * nx + ny * ny)
    if length == 0:
        return 1.0, 0.0, m[1], 0.0
    nx, ny = nx / length, ny / length
    return nx, ny, nx * m[1] + ny * m[2], max(half - root, 0.0)


@inlined
def chi_square(m: Array, v_rho: float, v_theta: float) -> float:
    """Squared distances of a piece's points from its best line, over their mean effective variance (MATH 1).

    A short piece close by scatters more along the beams than it is wide, and its best line follows the beams:
    the small variance of that direction makes such a line expensive.
    """
    half, dev = (m[3] + m[5]) / 2, (m[3] - m[5]) / 2
    root = np.sqrt(dev * dev + m[4] * m[4])
    if root == 0:
        return 0.0
    # n n^T = (1 - D) / 2 and t t^T = (1 + D) / 2 with D = [[dev, xy], [xy, -dev]] / root, for n^T U n and t^T M t.
    across = 0.5 * (1 - (dev * (2 * m[6] - 1) + 2 * m[4] * m[7]) / root)
    mx, my = m[1], m[2]
    along = (
        half
        + 0.5 * (mx * mx + my * my)
        + root
        + 0.5 * (dev * (mx * mx - my * my) + 2 * m[4] * mx * my) / root
    )
    return m[0] * max(half - root, 0.0) / (v_rho * across + v_theta * along)


@inlined
def cost_of_joining(a: Array, b: Array, v_rho: float, v_theta: float, joined: Array) -> float:
    """By how much the chi-square of the residuals grows if one line serves both pieces."""
    join(a, b, joined)
    joined[8] = chi_square(joined, v_rho, v_theta)
    return joined[8] - a[8] - b[8]


@kernel
def merge(
    first: Ints,
    last: Ints,
    run: Ints,
    m: Array,
    count: int,
    v_rho: float,
    v_theta: float,
    cost: Array,
    chain: Ints,
) -> int:
    """Merge neighbours in one run while one line explains both, cheapest first; the number of pieces left.

    first, last, run (count,) and sums m (count, SUMS) are changed in place; cost (count,), chain (2, count) and the
    row m[count] are scratch.
    """
    joined, before, after = m[count], chain[0], chain[1]
    for i in range(count):
        before[i], after[i] = i - 1, i + 1
        cost[i] = _cost_after(i, after, run, m, count, v_rho, v_theta, joined)
    while True:
        i = _cheapest(cost, count)
        if not cost[i] < _MERGE_CHI2:
            break
        gone = after[i]
        cost_of_joining(m[i], m[gone], v_rho, v_theta, joined)
        m[i] = joined
        last[i], after[i], cost[gone] = last[gone], after[gone], np.inf
        run[gone] = -1
        if after[i] < count:
            before[after[i]] = i
        cost[i] = _cost_after(i, after, run, m, count, v_rho, v_theta, joined)
        k = before[i]
        if k >= 0:
            cost[k] = _cost_after(k, after, run, m, count, v_rho, v_theta, joined)
    kept = 0
    for i in range(count):
        if run[i] >= 0:
            first[kept], last[kept], run[kept], m[kept] = first[i], last[i], run[i], m[i]
            kept += 1
    return kept


@inlined
def _cost_after(
    i: int, after: Ints, run: Ints, m: Array, count: int, v_rho: float, v_theta: float, joined: Array
) -> float:
    """Cost of joining a piece with the one after it; infinite at the end of a run."""
    k = after[i]
    if k == count or run[k] != run[i]:
        return np.inf
    return cost_of_joining(m[i], m[k], v_rho, v_theta, joined)


@inlined
def _cheapest(cost: Array, count: int) -> int:
    best = 0
    for i in range(1, count):
        if cost[i] < cost[best]:
            best = i
    return best


@inlined
def refine_ends(points: Array, first: Ints, last: Ints, run: Ints, m: Array, count: int) -> None:
    """Move each common end of two neighbours in one run to where their lines explain the points best."""
    rho, c, s = points[0], points[1], points[2]
    for i in range(count - 1):
        if run[i] != run[i + 1]:
            continue
        ax, ay, ar, _ = line_of(m[i])
        bx, by, br, _ = line_of(m[i + 1])
        low = max(first[i] + 1, last[i] - _REFINE_REACH)
        high = min(last[i + 1] - 1, last[i] + _REFINE_REACH)
        cost = least = 0.0
        best = low - 1
        for k in range(low, high):
            cost += (rho[k] * (ax * c[k] + ay * s[k]) - ar) ** 2 - (
                rho[k] * (bx * c[k] + by * s[k]) - br
            ) ** 2
            if cost < least:
                best, least = k, cost
        last[i] = best
        first[i + 1] = best + 1


@inlined
def split_runs(
    points: Array,
    starts: Ints,
    threshold: float,
    v_rho: float,
    v_theta: float,
    distance: Array,
    stack: Ints,
    first: Ints,
    last: Ints,
    run: Ints,
) -> int:
    """Split every run (starts[k] up to starts[k + 1]) into pieces; the number of pieces, in the order of the ring."""
    count = 0
    for k in range(len(starts) - 1):
        a = starts[k]
        ends = last[count:]
        n_ends = split(points, a, starts[k + 1] - 1, threshold, v_rho, v_theta, distance, stack, ends)
        for e in range(n_ends):
            first[count + e], run[count + e] = a, k
            a = ends[e] + 1
        count += n_ends
    return count


@kernel
def find_pieces(
    points: Array,
    beams: Ints,
    n: int,
    v_rho: float,
    v_theta: float,
    threshold: float,
    gap: float,
    increment: float,
    scratch: Array,
    indices: Ints,
) -> tuple[Ints, Ints]:
    """First and last point (P,) of each piece, in the order of the ring.

    points (3, 2 n) and beams (2 n,) hold n points and room to unroll the ring, so that it starts at a break and the
    result does not depend on where the scan starts. increment is the mean angle between beams, rad;
    scratch (2 n,) and indices (6, 2 n) are scratch that the result is a part of.
    """
    starts, first, last, run, stack = indices[0], indices[1], indices[2], indices[3], indices[4]
    n_runs = find_breaks(points, n, gap, increment, scratch, starts)
    if n_runs == 0:  # a closed room: start where the ring surely bends
        starts[0], n_runs = np.argmax(points[0, :n]), 1
    starts[n_runs] = starts[0] + n
    unroll(points, beams, n, starts[0])
    count = split_runs(
        points, starts[: n_runs + 1], threshold, v_rho, v_theta, scratch, stack, first, last, run
    )
    m = np.empty((count + 1, SUMS))
    for p in range(count):
        inside = slice(first[p], last[p] + 1)
        sums(points[0, inside], points[1, inside], points[2, inside], m[p])
        m[p, 8] = chi_square(m[p], v_rho, v_theta)
    count = merge(first, last, run, m, count, v_rho, v_theta, scratch, indices[4:])
    refine_ends(points, first, last, run, m, count)
    return first[:count], last[:count]
