import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lidarcore_app.scene.colours import categorical, rgb, turbo, untoned
from lidarcore_app.scene.palette import METHOD_STYLES, method_rgb
from lidarcore_app.scene.shapes import (
    DISC_FACES,
    DISC_VERTICES,
    about_z,
    beams_between,
    ellipses,
    lift,
    polylines,
)
from numpy.testing import assert_allclose

from lidarcore import FITTERS, Scan

ACES_IN = [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]]
ACES_OUT = [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]


def toned(colours: np.ndarray) -> np.ndarray:
    """What three.js makes of a linear colour: ACESFilmicToneMapping, then sRGB; bytes to bytes."""
    v = np.array(ACES_IN) @ (colours.T / 255 / 0.6)
    v = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
    linear = np.clip(np.array(ACES_OUT) @ v, 0, 1)
    return 255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055).T


@given(st.tuples(*[st.integers(25, 230)] * 3))
def test_colours_are_undone_before_viser_tones_them(linear: tuple[int, int, int]) -> None:
    """For every colour that tone mapping can give at all; a byte more or less of it shows most in dark ones."""
    shown = toned(np.array([linear], float))
    assert_allclose(toned(untoned(np.round(shown).astype(np.uint8)).astype(float)), shown, atol=4)


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_methods_are_told_apart_in_the_scene(theme: str) -> None:
    shown = np.array([toned(untoned(method_rgb(name, theme))[None].astype(float))[0] for name in FITTERS])
    distances = np.linalg.norm(shown[:, None] - shown, axis=2) + 1e3 * np.eye(len(shown))
    assert distances.min() > 50


def test_every_method_has_a_colour_of_its_own() -> None:
    assert METHOD_STYLES.keys() == FITTERS.keys()
    assert rgb("#0102ff") == (1, 2, 255)


def test_colour_scales_are_bytes_and_tell_neighbours_apart() -> None:
    assert turbo(np.array([0.0, 0.5, 1.0, 2.0, -1.0])).shape == (5, 3)
    low, middle, high = turbo(np.array([0.0, 0.5, 1.0])).astype(int)
    assert middle[1] > 200
    assert high[0] > high[2]
    assert low[2] > low[1]
    colours = categorical(30).astype(int)
    assert np.abs(np.diff(colours, axis=0)).sum(axis=1).min() > 60


@given(st.floats(1e-3, 0.1), st.floats(1e-3, 0.1), st.floats(-3, 3), st.floats(1, 100))
def test_an_ellipse_is_where_the_mahalanobis_distance_is_the_scale(
    a: float, b: float, turn: float, scale: float
) -> None:
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s], [s, c]])
    covariance = rotation @ np.diag([a**2, b**2]) @ rotation.T
    half, angle, outline = ellipses(np.array([[1.0, 2.0]]), covariance[None], scale)
    d = outline[0] - [1.0, 2.0]
    distances = np.einsum("pi,ij,pj->p", d, np.linalg.inv(covariance), d)
    assert_allclose(distances, scale**2, rtol=1e-5)
    # The disc, scaled and turned as viser does, is the same ellipse.
    w, _, _, z = about_z(angle)[0].astype(float)
    turned = 2 * np.arctan2(z, w)
    vertices = DISC_VERTICES[1:, :2] * half[0]
    x = np.cos(turned) * vertices[:, 0] - np.sin(turned) * vertices[:, 1]
    y = np.sin(turned) * vertices[:, 0] + np.cos(turned) * vertices[:, 1]
    disc = np.stack([x, y], -1)
    assert_allclose(np.einsum("pi,ij,pj->p", disc, np.linalg.inv(covariance), disc), scale**2, rtol=1e-4)


def test_a_disc_is_closed_and_faces_up() -> None:
    a, b, c = (DISC_VERTICES[DISC_FACES[:, i]] for i in range(3))
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(np.pi, rel=0.01)


def test_beams_between_two_go_along_the_ring_and_leave_out_missing_ones() -> None:
    scan = Scan([1, 1, np.nan, 1, 1, 1], np.linspace(0, 5, 6))
    assert beams_between(scan, 1, 4).tolist() == [1, 3, 4]
    assert beams_between(scan, 4, 1).tolist() == [4, 5, 0, 1]
    assert beams_between(scan, 3, 3).tolist() == [3]


def test_polylines_are_taken_apart_and_lifted() -> None:
    square = np.array([[[0, 0], [1, 0], [1, 1], [0, 0]]], float)
    assert polylines(square).tolist() == [[[0, 0], [1, 0]], [[1, 0], [1, 1]], [[1, 1], [0, 0]]]
    assert lift(square, 2.0).dtype == np.float32
    assert (lift(square, 2.0)[..., 2] == 2).all()
