"""Iterative end point fit: split a run of points until each piece is straight."""

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import finite_kernel, inlined, kernel
from lidarcore.noise import NoiseModel
from lidarcore.segmentation.pieces import Pieces

_SIGMAS = 3.0  # a point may be this far from the chord by noise
_CHORD_SHARE = 1.5  # the ends of the chord are noisy too: variance of the distance over that of the point


@inlined
def split_runs(
    points: Array,
    starts: Ints,
    threshold: float,
    noise: NoiseModel,
    distance: Array,
    stack: Ints,
    pieces: Pieces,
) -> int:
    """Split every run (starts[k] up to starts[k + 1]) into pieces; the number of pieces, in the order of the ring."""
    count = 0
    for k in range(len(starts) - 1):
        a = starts[k]
        ends = pieces.last[count:]
        n_ends = split(points, a, starts[k + 1] - 1, threshold, noise, distance, stack, ends)
        for e in range(n_ends):
            pieces.first[count + e], pieces.run[count + e] = a, k
            a = ends[e] + 1
        count += n_ends
    return count


@kernel
def split(
    points: Array,
    first: int,
    last: int,
    threshold: float,
    noise: NoiseModel,
    distance: Array,
    stack: Ints,
    ends: Ints,
) -> int:
    """Iterative end point fit of one run: the last point of each piece into ends, in order; their number.

    A piece is split where a point is farther from its chord than the threshold and than the noise explains. Where the
    unevenness of walls is known, that decides alone: what it does not explain is not one wall.
    """
    if noise.v_wall > 0:
        threshold = 0.0
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
            limit = _SIGMAS * _SIGMAS * _CHORD_SHARE * variance(rho[k], across, along, noise)
            if largest > threshold and largest * largest > limit:
                stack[depth] = k
                depth += 1
                continue
        ends[n_ends] = last
        n_ends += 1
        first = last
        depth -= 1
    return n_ends


@inlined
def variance(rho: float, across: float, along: float, noise: NoiseModel) -> float:
    """Variance of a point's distance from a line: its coordinate `along` it, its beam at cos(incidence) `across`."""
    square = rho * rho
    v_rho = noise.v_rho + noise.growth * square * square
    return v_rho * across * across + noise.v_theta * along * along + noise.v_wall


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
