"""Total least squares in polar form, weighted [CWLF 3, 16-19]."""

from lidarcore.arrays import Array
from lidarcore.compiled import inlined
from lidarcore.lines.regression import (
    NO_LINE,
    OK,
    Fit,
    Moments,
    Sym2,
    moments,
    total_least_squares,
    weights_determinant,
)


@inlined
def fit(rho: Array, c: Array, s: Array, v_rho: float, v_theta: float, w: Array) -> Fit:
    """Fit one piece; the double sums of [17] factor into moments, so the cost is O(N)."""
    weights_determinant(w, rho)
    m = moments(w, rho, c, s)
    status, nx, ny, r = total_least_squares(m)
    if status != OK:
        return status, NO_LINE, NO_LINE
    if r < 0:
        nx, ny, r = -nx, -ny, -r
    return OK, (nx, ny, r), _published(w, rho, c, s, v_rho, v_theta, m, nx, ny)


@inlined
def _published(
    w: Array, rho: Array, c: Array, s: Array, v_rho: float, v_theta: float, m: Moments, nx: float, ny: float
) -> Sym2:
    """[CWLF 19]: sum of v_rho g g^T + v_theta h h^T, g and h the derivatives of (alpha, r) by rho_i and theta_i.

    The weights are held fixed, as Arras and Siegwart do; w_i depends on the measurement itself, but to first order
    its derivative multiplies residuals that are zero on the line.
    """
    w_sum, x_mean, y_mean, xx, xy, yy = m
    d, n = yy - xx, -2 * xy  # alpha = atan2(n, d) / 2
    scale = 1 / (w_sum * (d * d + n * n))
    lever = ny * x_mean - nx * y_mean  # minus the coordinate of the mean along the line
    aa = ar = rr = 0.0
    for i in range(len(rho)):
        u, v = rho[i] * c[i] - x_mean, rho[i] * s[i] - y_mean
        alpha_x, alpha_y = scale * w[i] * (n * u - d * v), scale * w[i] * (-d * u - n * v)
        alpha_rho = alpha_x * c[i] + alpha_y * s[i]
        alpha_theta = rho[i] * (alpha_y * c[i] - alpha_x * s[i])
        share = w[i] / w_sum
        r_rho = share * (nx * c[i] + ny * s[i]) - lever * alpha_rho
        r_theta = share * rho[i] * (ny * c[i] - nx * s[i]) - lever * alpha_theta
        aa += v_rho * alpha_rho * alpha_rho + v_theta * alpha_theta * alpha_theta
        ar += v_rho * alpha_rho * r_rho + v_theta * alpha_theta * r_theta
        rr += v_rho * r_rho * r_rho + v_theta * r_theta * r_theta
    return aa, ar, rr
