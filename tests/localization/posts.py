"""Posts: round landmarks of known radius, found where a scan stands out from what is behind it."""

import numpy as np

from lidarcore.geometry import unit_vectors
from lidarcore.localization.points import Points
from lidarcore.noise import SensorNoise
from lidarcore.scan import Array, Ints, Scan

_STEPS = 6
_LIKELY = 6.0  # reduced chi-square of a fit at most: real posts are not ideal cylinders
_WIDTHS = 0.6, 1.2  # of what the radius spans: the outermost beams miss, or see what is behind as well


def find_posts(scan: Scan, radius: float, noise: SensorNoise, min_points: int = 5) -> Points:
    """Centres of the posts of a radius in m, sensor frame, with the covariance of the fit under the noise.

    A post is a run of beams nearer than both its neighbours, as wide as a circle of that radius is at that
    distance, whose ranges fit that circle. Gauss-Newton on the ranges, as in a maximum likelihood fit.
    """
    found = [
        fit
        for run in _runs(scan, radius, min_points)
        if (fit := fit_circle(scan.ranges[run], scan.bearings[run], radius, noise)) is not None
    ]
    centres, covariances = zip(*found, strict=True) if found else ((), ())
    return Points(np.reshape(centres, (-1, 2)), np.reshape(covariances, (-1, 2, 2)), "post")


def fit_circle(
    ranges: Array, bearings: Array, radius: float, noise: SensorNoise
) -> tuple[Array, Array] | None:
    """Centre (2,) m and its covariance (2, 2) of a circle of known radius; None if the ranges do not fit one."""
    u = unit_vectors(bearings)
    middle = len(ranges) // 2
    centre = (ranges[middle] + radius) * u[middle]
    across = np.stack([-u[:, 1], u[:, 0]], -1)
    for _ in range(_STEPS):
        # rho = p - sqrt(r^2 - q^2) with p, q the centre along and across the beam.
        p, q = u @ centre, across @ centre
        depth = np.sqrt(np.maximum(radius**2 - q**2, (0.1 * radius) ** 2))
        J = u + (q / depth)[:, None] * across
        slope = q - p * q / depth  # d rho / d theta
        variance = noise.sigma_range**2 + (slope * noise.sigma_bearing) ** 2
        information = (J / variance[:, None]).T @ J
        residual = ranges - p + depth
        centre = centre + np.linalg.solve(information, J.T @ (residual / variance))
    if (residual**2 / variance).sum() > _LIKELY * (len(ranges) - 2) or np.abs(across @ centre).max() > radius:
        return None
    return centre, np.linalg.inv(information)


def _runs(scan: Scan, radius: float, min_points: int) -> list[Ints]:
    """Beams, around the ring, of runs without a step that stand out and are as wide as the post would be."""
    ranges = np.where(scan.valid, scan.ranges, np.inf)
    with np.errstate(invalid="ignore"):
        edges = np.flatnonzero(~(np.abs(ranges - np.roll(ranges, 1)) < radius))
    runs = []
    for first, after in zip(edges, np.roll(edges, -1), strict=True):
        run = (first + np.arange((after - first) % len(scan))) % len(scan)
        if len(run) < min_points or not np.isfinite(ranges[run]).all():
            continue
        nearer = ranges[run[0]] < ranges[first - 1] and ranges[run[-1]] < ranges[after]
        width = (scan.bearings[run[-1]] - scan.bearings[run[0]]) % (2 * np.pi)
        expected = 2 * np.arcsin(radius / (ranges[run].min() + radius))
        if nearer and _WIDTHS[0] * expected < width < _WIDTHS[1] * expected:
            runs.append(run)
    return runs
