"""The papers' formulas, written again straight from their equations, in plain numpy.

Derivatives are exact to rounding by complex steps, f'(x) = Im f(x + ih) / h, so that nothing is derived by hand
unless the paper prints it. Lines come as (alpha, r) with a covariance, r >= 0.
"""

import numpy as np

STEP = 1e-100


def jacobian(function, *values: np.ndarray) -> list[np.ndarray]:
    """Derivatives of function(*values) (M,) by each entry of each value (N,): a list of (M, N)."""
    result = []
    for k, value in enumerate(values):
        columns = []
        for i in range(len(value)):
            moved = [np.array(v, complex) for v in values]
            moved[k][i] += 1j * STEP
            columns.append(np.imag(function(*moved)) / STEP)
        result.append(np.array(columns).T)
    return result


def normal_form(a, b, c):
    """(alpha, r) of a x + b y + c = 0, c real part < 0 after orientation; works on complex steps."""
    sign = -1.0 if np.real(c) > 0 else 1.0
    a, b, c = sign * a, sign * b, sign * c
    base = np.arctan2(np.real(b), np.real(a))
    ca, sa = np.cos(base), np.sin(base)
    return np.array([base + np.arctan((ca * b - sa * a) / (ca * a + sa * b)), -c / np.sqrt(a * a + b * b)])


def propagate(noise, by_range: np.ndarray, by_bearing: np.ndarray) -> np.ndarray:
    """J diag(sigma_range^2, sigma_bearing^2) J^T, summed over the beams: [CWLF 19], [WCTLS 6, 14]."""
    return noise.sigma_range**2 * by_range @ by_range.T + noise.sigma_bearing**2 * by_bearing @ by_bearing.T


def inverse_determinant(ranges, noise):
    """Weights [CWLF 3], [WCTLS 8]."""
    return 1 / (noise.sigma_range * ranges * noise.sigma_bearing) ** 2


# Arras-Siegwart [CWLF 16-19]


def arras_siegwart(ranges, bearings, noise):
    w = inverse_determinant(ranges, noise)

    def line(rho, theta):
        """[17] with its double sums, then [16]; atan2 keeps the branch with the least squares."""
        sine, cosine, total = np.sin(theta), np.cos(theta), w.sum()
        wr = w * rho
        numerator = (
            2 / total * (np.outer(wr, wr) * np.outer(sine, cosine)).sum()
            - (w * rho**2 * np.sin(2 * theta)).sum()
        )
        denominator = (
            1 / total * (np.outer(wr, wr) * np.cos(theta[:, None] + theta)).sum()
            - (w * rho**2 * np.cos(2 * theta)).sum()
        )
        base = np.arctan2(np.real(numerator), np.real(denominator))
        c, s = np.cos(base), np.sin(base)
        turn = np.arctan((c * numerator - s * denominator) / (c * denominator + s * numerator))
        alpha = (base + turn) / 2
        r = (wr * np.cos(theta - alpha)).sum() / total
        return np.array([alpha, r]) if np.real(r) >= 0 else np.array([alpha + np.pi, -r])

    return np.real(line(ranges, bearings)), propagate(noise, *jacobian(line, ranges, bearings))


# CWLF [20-35], [40-48]


def cwlf_regression(ranges, bearings, noise):
    """("y" or "x", slope, intercept at the mean, mean, variances) by [20-35]."""
    x, y = ranges * np.cos(bearings), ranges * np.sin(bearings)
    n = len(x)
    n_1 = n * ((x - x.mean()) ** 2).sum()  # [20]
    n_2 = n * ((y - y.mean()) ** 2).sum()  # [21]
    v_t, v_r = (ranges * noise.sigma_bearing) ** 2, noise.sigma_range**2
    if n_1 >= n_2:
        kind, u, v = "y", x, y
        w = np.cos(bearings) ** 2 / v_t + np.sin(bearings) ** 2 / v_r  # [23]
    else:
        kind, u, v = "x", y, x
        w = np.sin(bearings) ** 2 / v_t + np.cos(bearings) ** 2 / v_r  # [34]
    mean = (w * u).sum() / w.sum()
    xi = u - mean  # [27]
    slope = (w * xi * v).sum() / (w * xi**2).sum()  # [29]
    intercept = (w * v).sum() / w.sum()  # [30]
    v_slope = ((w * xi / (w * xi**2).sum()) ** 2 / w).sum()  # [31], its first sum without the misprint
    v_intercept = ((w / w.sum()) ** 2 / w).sum()  # [32]
    return kind, slope, intercept, mean, np.diag([v_slope, v_intercept])


def cwlf(ranges, bearings, noise):
    kind, slope, intercept, mean, covariance = cwlf_regression(ranges, bearings, noise)

    def line(p):
        a, b, c = p[0], -1.0 + 0 * p[0], p[1] - p[0] * mean  # slope u - v + (intercept - slope mean) = 0
        return normal_form(a, b, c) if kind == "y" else normal_form(b, a, c)

    parameters = np.array([slope, intercept])
    (J,) = jacobian(line, parameters)
    return np.real(line(parameters)), J @ covariance @ J.T


def cwlf_corner(first, second):
    """Corner and covariance of two regressions by case a, b or c."""
    kinds = first[0] + second[0]
    if kinds == "xy":  # case c is written for a y regression and an x regression
        first, second, kinds = second, first, "yx"
    (_, _, _, u_1, C_1), (_, _, _, u_2, C_2) = first, second

    def case_a(p):
        m_1, b_1, m_2, b_2 = p
        return np.array(
            [
                (m_2 * u_2 - m_1 * u_1 + b_1 - b_2) / (m_2 - m_1),  # [40]
                (m_1 * m_2 * (u_2 - u_1) + m_2 * b_1 - m_1 * b_2) / (m_2 - m_1),  # [41]
            ]
        )

    def case_b(p):
        s_1, h_1, s_2, h_2 = p
        return np.array(
            [
                (s_1 * s_2 * (u_2 - u_1) + s_2 * h_1 - s_1 * h_2) / (s_2 - s_1),  # [43]
                (s_2 * u_2 - s_1 * u_1 + h_1 - h_2) / (s_2 - s_1),  # [44]
            ]
        )

    def case_c(p):
        m, b, s, h = p
        return np.array(
            [
                (-m * s * u_1 + s * b - s * u_2 + h) / (1 - m * s),  # [46]
                (-m * s * u_2 + m * h - m * u_1 + b) / (1 - m * s),  # [47]
            ]
        )

    corner = {"yy": case_a, "xx": case_b, "yx": case_c}[kinds]
    parameters = np.array([first[1], first[2], second[1], second[2]])
    covariance = np.block([[C_1, np.zeros((2, 2))], [np.zeros((2, 2)), C_2]])
    (J,) = jacobian(corner, parameters)
    return {"yy": "a", "xx": "b", "yx": "c"}[kinds], np.real(corner(parameters)), J @ covariance @ J.T


# UTLS and WTLS [WCTLS 1-15], corners [24-25]


def implicit(ranges, bearings, noise, weighted: bool):
    """(a, b, c) [2-4, 10-12] and the terms printed in [7, 15]: (3, N) by range, (3, N) by bearing."""
    w = inverse_determinant(ranges, noise) if weighted else np.ones_like(ranges)
    total = w.sum()
    x, y = ranges * np.cos(bearings), ranges * np.sin(bearings)
    X, Y = (w * x).sum() / total, (w * y).sum() / total
    XX, YY, XY = (w * x * x).sum() / total, (w * y * y).sum() / total, (w * x * y).sum() / total
    abc = total**2 * np.array([X * YY - Y * XY, Y * XX - X * XY, XY**2 - XX * YY])
    if weighted:
        by_range = (w * total / ranges) * np.array([-x * YY + y * XY, -y * XX + x * XY, 0 * x])  # T
    else:
        by_range = (total / ranges) * np.array(  # R
            [
                x * YY + 2 * y**2 * X - y * XY - 2 * x * y * Y,
                y * XX + 2 * x**2 * Y - x * XY - 2 * x * y * X,
                2 * (2 * x * y * XY - x**2 * YY - y**2 * XX),
            ]
        )
    by_bearing = (w * total) * np.array(  # S, U
        [
            -y * YY + 2 * x * y * X - x * XY - (x**2 - y**2) * Y,
            x * XX - 2 * x * y * Y + y * XY - (x**2 - y**2) * X,
            2 * ((x**2 - y**2) * XY + x * y * (YY - XX)),
        ]
    )
    return abc, by_range, by_bearing


def implicit_sums(rho, theta, noise, weighted: bool):
    """(a, b, c) as in [2-4, 10-12], on complex steps: what the printed terms are the derivatives of."""
    w = inverse_determinant(rho, noise) if weighted else np.ones_like(rho)
    x, y = rho * np.cos(theta), rho * np.sin(theta)
    sx, sy, sxx, syy, sxy = ((w * v).sum() for v in (x, y, x * x, y * y, x * y))
    return np.array([sx * syy - sy * sxy, sy * sxx - sx * sxy, sxy**2 - sxx * syy])


def implicit_line(ranges, bearings, noise, weighted: bool):
    abc, by_range, by_bearing = implicit(ranges, bearings, noise, weighted)
    (J,) = jacobian(lambda p: normal_form(*p), abc)
    return np.real(normal_form(*abc)), propagate(noise, J @ by_range, J @ by_bearing)


def implicit_corner(first, second):
    """Corner [24-25] of two lines ((a, b, c), covariance (3, 3)), and its covariance."""

    def corner(p):
        a, b, c, d, e, f = p
        return np.array([(b * f - e * c) / (a * e - d * b), (d * c - a * f) / (a * e - d * b)])

    parameters = np.concatenate([first[0], second[0]])
    covariance = np.zeros((6, 6))
    covariance[:3, :3], covariance[3:, 3:] = first[1], second[1]
    (J,) = jacobian(corner, parameters)
    return np.real(corner(parameters)), J @ covariance @ J.T


# WCTLS [16-23]


def conformal(ranges, bearings, noise):
    """Q of the weighted sums, and C_Q as reconstructed: information of a regression with conditional variances."""
    a, b, c = implicit(ranges, bearings, noise, weighted=True)[0]
    Q = np.array([a / c, b / c])
    n = Q / np.linalg.norm(Q)
    information = np.zeros((2, 2))
    for rho, theta in zip(ranges, bearings, strict=True):
        R = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
        C = R @ np.diag([noise.sigma_range**2, (rho * noise.sigma_bearing) ** 2]) @ R.T
        conditional = 1 / (n @ np.linalg.inv(C) @ n)
        p = rho * R[:, 0]
        information += np.outer(p, p) / (Q @ Q * conditional)
    return Q, np.linalg.inv(information)


def conformal_implicit(ranges, bearings, noise):
    """(a, b, c) normalised [18-21] and covariance [22] with the Jacobian printed in [23]."""
    (x, y), C_Q = conformal(ranges, bearings, noise)
    q = np.hypot(x, y)
    J = np.array([[y**2, -x * y], [-x * y, x**2], [-x, -y]]) / q**3
    return np.array([x, y, 1]) / q, J @ C_Q @ J.T


def conformal_line(ranges, bearings, noise):
    abc, covariance = conformal_implicit(ranges, bearings, noise)
    (J,) = jacobian(lambda p: normal_form(*p), abc)
    return np.real(normal_form(*abc)), J @ covariance @ J.T
