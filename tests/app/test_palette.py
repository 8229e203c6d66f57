"""The six methods are told apart with any colour vision, as three simulations of Machado et al. (2009) say."""

from itertools import combinations

import numpy as np
import pytest
from lidarcore_app.scene.palette import METHOD_STYLES, PALETTE, method_rgb, stylesheet
from lidarcore_app.web.server import STATIC
from numpy.testing import assert_allclose

LEAST = 15  # CIEDE2000
CONTRAST = 3  # of graphics to their ground, WCAG 2.1, 1.4.11
GROUNDS = {"dark": [20, 20, 20], "light": [255, 255, 255]}
# On linear RGB, severity 1.0: Machado, Oliveira, Fernandes, "A Physiologically-based Model for Simulation of Color
# Vision Deficiency", IEEE Transactions on Visualization and Computer Graphics 15 (2009), 1291-1298.
VISIONS = {
    "normal": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}  # fmt: skip
TO_XYZ = np.array(  # sRGB, IEC 61966-2-1, D65
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)


def linear(rgb: np.ndarray) -> np.ndarray:
    part = np.asarray(rgb, float) / 255
    return np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    """CIELAB of linear RGB."""
    t = TO_XYZ @ np.clip(rgb, 0, 1) / TO_XYZ.sum(axis=1)
    x, y, z = np.where(t > 216 / 24389, np.cbrt(t), (24389 / 27 * t + 16) / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def ciede2000(first: np.ndarray, second: np.ndarray) -> float:
    """Sharma, Wu, Dalal, "The CIEDE2000 color-difference formula", Color Research & Application 30 (2005), 21-30."""
    (L1, a1, b1), (L2, a2, b2) = first, second
    mean = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2
    G = (1 - np.sqrt(mean**7 / (mean**7 + 25.0**7))) / 2
    C1, C2 = np.hypot((1 + G) * a1, b1), np.hypot((1 + G) * a2, b2)
    h1, h2 = (np.degrees(np.arctan2(b, (1 + G) * a)) % 360 for a, b in ((a1, b1), (a2, b2)))
    apart = (h2 - h1 + 180) % 360 - 180 if C1 * C2 else 0.0
    dL, dC, dH = L2 - L1, C2 - C1, 2 * np.sqrt(C1 * C2) * np.sin(np.radians(apart / 2))
    L, C = (L1 + L2) / 2, (C1 + C2) / 2
    h = (h1 + apart / 2) % 360 if C1 * C2 else h1 + h2
    parts = zip((-0.17, 0.24, 0.32, -0.2), (h - 30, 2 * h, 3 * h + 6, 4 * h - 63), strict=True)
    T = 1 + sum(weight * np.cos(np.radians(angle)) for weight, angle in parts)
    turn = 30 * np.exp(-(((h - 275) / 25) ** 2))
    R = -np.sin(np.radians(2 * turn)) * 2 * np.sqrt(C**7 / (C**7 + 25.0**7))
    lightness = dL / (1 + 0.015 * (L - 50) ** 2 / np.sqrt(20 + (L - 50) ** 2))
    chroma, hue = dC / (1 + 0.045 * C), dH / (1 + 0.015 * C * T)
    return float(np.sqrt(lightness**2 + chroma**2 + hue**2 + R * chroma * hue))


@pytest.mark.parametrize(
    ("first", "second", "difference"),
    [
        ((50, 2.6772, -79.7751), (50, 0, -82.7485), 2.0425),
        ((50, 2.49, -0.001), (50, -2.49, 0.0009), 7.1792),
        ((50, 2.5, 0), (73, 25, -18), 27.1492),
        ((22.7233, 20.0904, -46.694), (23.0331, 14.973, -42.5619), 2.0373),
        ((2.0776, 0.0795, -1.135), (0.9033, -0.0636, -0.5514), 0.9082),
    ],
)
def test_the_formula_gives_what_its_authors_publish(first: tuple, second: tuple, difference: float) -> None:
    assert_allclose(ciede2000(np.array(first), np.array(second)), difference, atol=1e-4)


@pytest.mark.parametrize("theme", GROUNDS)
@pytest.mark.parametrize("vision", VISIONS)
def test_any_eye_tells_the_methods_apart(vision: str, theme: str) -> None:
    seen = {name: lab(np.array(VISIONS[vision]) @ linear(method_rgb(name, theme))) for name in METHOD_STYLES}
    apart = {pair: round(ciede2000(*map(seen.get, pair)), 1) for pair in combinations(seen, 2)}
    assert {pair: value for pair, value in apart.items() if value < LEAST} == {}


@pytest.mark.parametrize("theme", GROUNDS)
def test_methods_stand_out_from_the_ground(theme: str) -> None:
    ground = TO_XYZ[1] @ linear(np.array(GROUNDS[theme]))
    for name in METHOD_STYLES:
        low, high = sorted([ground, TO_XYZ[1] @ linear(method_rgb(name, theme))])
        assert (high + 0.05) / (low + 0.05) >= CONTRAST, name


def test_every_method_has_a_dash_of_its_own() -> None:
    assert len({style.dash for style in METHOD_STYLES.values()}) == len(METHOD_STYLES)


def test_the_page_has_the_colours_of_the_scene_from_one_place() -> None:
    written = "".join(path.read_text() for path in (STATIC / "css").glob("*.css"))
    for name, dark in PALETTE["dark"].items():
        light = PALETTE["light"][name]
        assert f"--{name}: light-dark({light}, {dark});" in stylesheet()
        assert light not in written, name
        assert dark not in written, name
    assert "var(--wall)" in written
    assert "var(--trail)" in written
