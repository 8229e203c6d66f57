"""A corner from the beams of two walls in the four steps of [CWLF], in numpy, as the paper writes them.

The steps are what Fig. 3 to 5 of the paper time: lines, their covariances, corner, its covariance. The library takes
them in one pass; here they are apart, the double sums of [17] left as they are.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import unit_vectors
from lidarcore.noise import SensorNoise

Beams = tuple[Array, Array]
"""Ranges (N,) m and bearings (N,) rad of one wall, sensor frame."""
STEPS = ("lines", "covariance of the lines", "corner", "covariance of the corner")


@dataclass(frozen=True, slots=True)
class Method:
    """A method as four functions: line of beams, its covariance, corner (2,) of two lines, its covariance (2, 2)."""

    line: Callable[[Beams, SensorNoise], Any]
    line_covariance: Callable[[Any, SensorNoise], Array]
    corner: Callable[[Any, Any], Array]
    corner_covariance: Callable[[Any, Any, Array, Array, Array], Array]


def corner(method: Method, walls: tuple[Beams, Beams], noise: SensorNoise) -> tuple[Array, Array]:
    """All four steps: the corner (2,) m and its published covariance (2, 2) m²."""
    j, k = (method.line(wall, noise) for wall in walls)
    cj, ck = (method.line_covariance(line, noise) for line in (j, k))
    xy = method.corner(j, k)
    return xy, method.corner_covariance(j, k, xy, cj, ck)


@dataclass(frozen=True, slots=True, eq=False)
class _Polar:
    alpha: float
    r: float
    beams: Beams
    w: Array
    numerator: float
    denominator: float


def _polar_line(beams: Beams, noise: SensorNoise) -> _Polar:
    rho, theta = beams
    w = 1 / (noise.sigma_range * rho * noise.sigma_bearing) ** 2  # [3]
    W, wr = w.sum(), w * rho
    pairs = np.outer(wr, wr)
    sines, cosines = np.outer(np.sin(theta), np.cos(theta)), np.cos(theta[:, None] + theta)
    numerator = 2 / W * (pairs * sines).sum() - (wr * rho * np.sin(2 * theta)).sum()  # [17]
    denominator = 1 / W * (pairs * cosines).sum() - (wr * rho * np.cos(2 * theta)).sum()
    alpha = np.arctan2(numerator, denominator) / 2
    r = (wr * np.cos(theta - alpha)).sum() / W  # [16]
    if r < 0:
        alpha, r = alpha + np.pi, -r
    return _Polar(alpha, r, beams, w, numerator, denominator)


def _polar_covariance(line: _Polar, noise: SensorNoise) -> Array:
    """Of (alpha, r) [19]: the derivative of a double sum is a sum over the other points, for each point."""
    rho, theta = line.beams
    w, W, wr = line.w, line.w.sum(), line.w * rho
    angles = theta[:, None] + theta
    sine, cosine = 2 / W * np.sin(angles) @ wr, 2 / W * np.cos(angles) @ wr
    s2, c2 = 2 * rho * np.sin(2 * theta), 2 * rho * np.cos(2 * theta)
    n, d = line.numerator, line.denominator

    def alpha_by(numerator: Array, denominator: Array) -> Array:
        return (d * numerator - n * denominator) / (2 * (n * n + d * d))

    alpha_rho = alpha_by(w * (sine - s2), w * (cosine - c2))
    alpha_theta = alpha_by(wr * (cosine - c2), wr * (s2 - sine))
    lever = (wr * np.sin(theta - line.alpha)).sum() / W
    r_rho = w * np.cos(theta - line.alpha) / W + lever * alpha_rho
    r_theta = -wr * np.sin(theta - line.alpha) / W + lever * alpha_theta
    g, h = np.stack([alpha_rho, r_rho]), np.stack([alpha_theta, r_theta])
    return noise.sigma_range**2 * g @ g.T + noise.sigma_bearing**2 * h @ h.T


def _polar_corner(j: _Polar, k: _Polar) -> Array:
    x = j.r * np.sin(k.alpha) - k.r * np.sin(j.alpha)  # [36]
    y = k.r * np.cos(j.alpha) - j.r * np.cos(k.alpha)  # [37]
    return np.array([x, y]) / np.sin(k.alpha - j.alpha)


def _polar_corner_covariance(j: _Polar, k: _Polar, xy: Array, cj: Array, ck: Array) -> Array:
    """[38]: n . p = r gives n . dp = dr - (t . p) dalpha, from which the Jacobian [39b] follows."""
    nj, nk = normals = unit_vectors([j.alpha, k.alpha])
    inverse = np.linalg.inv(normals)
    Jj = np.outer(inverse[:, 0], [nj[1] * xy[0] - nj[0] * xy[1], 1])
    Jk = np.outer(inverse[:, 1], [nk[1] * xy[0] - nk[0] * xy[1], 1])
    return Jj @ cj @ Jj.T + Jk @ ck @ Jk.T


@dataclass(frozen=True, slots=True, eq=False)
class _Regression:
    """v = slope (u - mean) + b, u the coordinate (0 for x, 1 for y) that spreads more."""

    u: int
    slope: float
    mean: float
    b: float
    w_sum: float
    spread: float


def _regression_line(beams: Beams, noise: SensorNoise) -> _Regression:
    rho, theta = beams
    trig = np.cos(theta), np.sin(theta)
    xy = rho * trig[0], rho * trig[1]
    u = int(xy[0].var() < xy[1].var())  # N_1 < N_2 [20, 21]
    w = (trig[u] / (rho * noise.sigma_bearing)) ** 2 + (trig[1 - u] / noise.sigma_range) ** 2  # [23], [34]
    w_sum = w.sum()
    mean = w @ xy[u] / w_sum
    xi = xy[u] - mean  # [27]
    spread = w @ (xi * xi)
    return _Regression(
        u, w @ (xi * xy[1 - u]) / spread, mean, w @ xy[1 - u] / w_sum, w_sum, spread
    )  # [29], [30]


def _regression_covariance(line: _Regression, noise: SensorNoise) -> Array:
    return np.array([1 / line.spread, 1 / line.w_sum])  # [31], [32]; the diagonal, they are uncorrelated


def _regression_corner(j: _Regression, k: _Regression) -> Array:
    if j.u == k.u:  # cases a and b [40, 41, 43, 44]
        u = (k.slope * k.mean - j.slope * j.mean + j.b - k.b) / (k.slope - j.slope)
        v = j.slope * (u - j.mean) + j.b
        return np.array([v, u] if j.u else [u, v], np.float64)
    m, s = (k, j) if j.u else (j, k)  # case c [46, 47]
    x = (-m.slope * s.slope * m.mean + s.slope * (m.b - s.mean) + s.b) / (1 - m.slope * s.slope)
    return np.array([x, m.slope * (x - m.mean) + m.b])


def _regression_corner_covariance(j: _Regression, k: _Regression, xy: Array, cj: Array, ck: Array) -> Array:
    """[42, 45, 48]: dv - slope du = (u - mean) dslope + db for each line, from which the Jacobians follow."""
    normals = [(-line.slope, 1.0) if line.u == 0 else (1.0, -line.slope) for line in (j, k)]
    inverse = np.linalg.inv(np.array(normals))
    along = xy[j.u] - j.mean, xy[k.u] - k.mean
    variances = np.array([along[0] ** 2 * cj[0] + cj[1], along[1] ** 2 * ck[0] + ck[1]])
    return inverse * variances @ inverse.T


METHODS = {
    "arras_siegwart": Method(_polar_line, _polar_covariance, _polar_corner, _polar_corner_covariance),
    "cwlf": Method(
        _regression_line, _regression_covariance, _regression_corner, _regression_corner_covariance
    ),
}
