"""Clouds of dots and the ellipses claimed for them, as SVG that is part of the page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from lidarcore.geometry import ellipse_axes
from lidarcore.reporting import WIDTH, svg
from lidarcore.scan import Array

from .views import GATE

_HEIGHT = 300
_TICKS = (1, 2, 5)
STYLES: Mapping[str, str] = {"published": "m1", "consistent": "m0"}
LEGEND = tuple((name, f"var(--{style})") for name, style in STYLES.items())


@dataclass(frozen=True, eq=False)
class Cloud:
    """Dots (K, 2) around the truth, in units of the axes, and 95 % ellipses: name in STYLES, covariance (2, 2)."""

    title: str
    dots: Array
    ellipses: Sequence[tuple[str, Array]]


def reach(clouds: Sequence[Cloud]) -> Array:
    """(2,) how far dots and ellipses go from the middle, so that clouds beside each other have one scale."""
    clouded = [np.abs(cloud.dots).max(0) for cloud in clouds]
    ellipses = [np.sqrt(GATE * np.diag(C)) for cloud in clouds for _, C in cloud.ellipses]
    farthest: Array = np.max([*clouded, *ellipses], axis=0)
    return farthest


def draw(cloud: Cloud, far: Array, units: tuple[str, str], equal: bool = True) -> str:
    """The cloud in a frame that reaches `far` (2,); axes of one scale, unless they are of different units."""
    half = np.array([WIDTH, _HEIGHT]) / 2
    scale = 0.94 * half / far
    if equal:
        scale = np.full(2, scale.min())
    flip = scale * [1, -1]  # y points up
    parts = [
        f'<path class="grid" d="M0 {half[1]}H{WIDTH}M{half[0]} 0V{_HEIGHT}"/>',
        dots(half + cloud.dots * flip),
        *(ellipse(half, C * np.outer(flip, flip), name) for name, C in cloud.ellipses),
        _bar(2 * half[0] / scale[0], scale[0], units[0], upright=False),
    ]
    if not equal:
        parts.append(_bar(2 * half[1] / scale[1], scale[1], units[1], upright=True))
    return svg(WIDTH, _HEIGHT, "".join(parts), cloud.title)


def dots(at: Array, style: str = "scan") -> str:
    """Dots at (K, 2), units of the drawing: lines of no length, of which round caps make dots."""
    return f'<path class="dots {style}" d="{"".join(f"M{x:.2f} {y:.2f}h0" for x, y in at)}"/>'


def ellipse(middle: Array, covariance: Array, name: str) -> str:
    """The 95 % ellipse of a covariance (2, 2) in units of the drawing."""
    (minor, major), directions = ellipse_axes(covariance, float(np.sqrt(GATE)))
    turn = np.degrees(np.arctan2(directions[1, 1], directions[0, 1]))
    return (
        f'<ellipse class="ellipse {STYLES[name]}" rx="{major:.3f}" ry="{minor:.3f}" '
        f'transform="translate({middle[0]:g} {middle[1]:g}) rotate({turn:.3f})" style="stroke-width: 2"/>'
    )


def _bar(width: float, scale: float, unit: str, upright: bool) -> str:
    """A length of a round number of units, to compare with."""
    target = width / 5
    power = 10.0 ** np.floor(np.log10(target))
    length = max(power * tick for tick in _TICKS if power * tick <= target)
    size = length * scale
    label = escape(f"{length:g} {unit}")
    if upright:
        y = _HEIGHT - 24
        return (
            f'<path class="whisker" d="M10 {y:.1f}V{y - size:.1f}"/>'
            f'<text class="tick" x="15" y="{y - size / 2 + 3:.1f}">{label}</text>'
        )
    return (
        f'<path class="whisker" d="M10 {_HEIGHT - 8}h{size:.1f}"/>'
        f'<text class="tick" x="{15 + size:.1f}" y="{_HEIGHT - 5}">{label}</text>'
    )
