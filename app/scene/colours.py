"""Colours as numbers: of segments by their order, of quality and range, and as they are before viser tones them."""

import numpy as np
from numpy.typing import NDArray

Rgb = tuple[int, int, int]
Rgbs = NDArray[np.uint8]

_TURBO = np.array(
    [
        [0.13572138, 4.61539260, -42.66032258, 132.13108234, -152.94239396, 59.28637943],
        [0.09140261, 2.19418839, 4.84296658, -14.18503333, 4.27729857, 2.82956604],
        [0.10667330, 12.64194608, -60.58204836, 110.36276771, -89.90310912, 27.34824973],
    ]
)

# ACES filmic tone mapping as three.js has it, which viser applies to lines and meshes but not to points.
_ACES_IN = np.array([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]])
_ACES_OUT = np.array(
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
)
_ACES_EXPOSURE = 0.6


def rgb(colour: str) -> Rgb:
    """'#rrggbb' as three bytes."""
    red, green, blue = bytes.fromhex(colour[1:])
    return red, green, blue


def categorical(count: int) -> Rgbs:
    """(count, 3) colours told apart by their order: neighbours are a golden angle of hue apart."""
    hue = (np.arange(count) * 0.618034)[:, None] % 1.0
    ramps = np.abs((hue * 6 + np.array([0.0, 4.0, 2.0])) % 6 - 3) - 1
    return np.asarray(255 * (0.35 + 0.6 * np.clip(ramps, 0, 1)), np.uint8)


def turbo(values: NDArray[np.float64]) -> Rgbs:
    """(N, 3) colours of values in 0..1: the polynomial of Mikhailov's Turbo map (Google, 2019)."""
    powers = np.clip(values, 0, 1)[:, None] ** np.arange(6)
    return np.asarray(255 * np.clip(powers @ _TURBO.T, 0, 1), np.uint8)


def untoned(colours: Rgbs) -> Rgbs:
    """(..., 3) colours that look like the given ones after viser's tone mapping, as nearly as a byte can."""
    srgb = colours / 255.0
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    y = linear @ np.linalg.inv(_ACES_OUT).T  # = (v (v + a) - b) / (v (c v + d) + e), solved for v
    a, b, c, d, e = 0.0245786, 0.000090537, 0.983729, 0.4329510, 0.238081
    square, half, rest = 1 - c * y, (a - d * y) / 2, b + e * y
    v = (np.sqrt(np.maximum(half**2 + square * rest, 0.0)) - half) / square
    return np.asarray(255 * np.clip(_ACES_EXPOSURE * v @ np.linalg.inv(_ACES_IN).T, 0, 1) + 0.5, np.uint8)
