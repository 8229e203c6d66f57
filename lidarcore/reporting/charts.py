"""Figures as SVG that is part of a page: its style sheet colours them, by day and by night."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import ellipse_outline

WIDTH = 380  # units of a panel, which are pixels where three fit beside each other
_LABELS, _VALUES, _ROW = 112, 80, 20  # units left and right of the bars, and from row to row
SIGMAS_95 = 2.4477  # of an ellipse that holds 95 % in the plane


@dataclass(frozen=True, slots=True)
class Bar:
    """A value with the ends of its interval, drawn in the style of a class; text stands beside it."""

    label: str
    value: float
    low: float
    high: float
    text: str
    style: str


def bars(
    rows: Sequence[Bar | str],
    most: float,
    *,
    title: str,
    least: float | None = None,
    mark: float | None = None,
) -> str:
    """Horizontal bars under headings (str), from 0 to `most`, or logarithmically from `least` on.

    mark: a value at which a dashed line is drawn through all of them.
    """
    room = WIDTH - _LABELS - _VALUES

    def x(value: float) -> float:
        share = value / most if least is None else np.log(max(value, least) / least) / np.log(most / least)
        return _LABELS + room * float(np.clip(share, 0, 1))

    parts, y = [], 4.0
    for row in rows:
        if isinstance(row, str):
            parts.append(f'<text class="heading" x="0" y="{y + 15:.0f}">{escape(row)}</text>')
        else:
            parts.append(_bar(row, x, y))
        y += _ROW
    if mark is not None:
        parts.append(f'<path class="reference" d="M{x(mark):.1f} 4V{y:.0f}"/>')
    return svg(WIDTH, y + 4, "".join(parts), title)


def _bar(bar: Bar, x: Callable[[float], float], y: float) -> str:
    middle = y + _ROW / 2
    whisker = ""
    if np.isfinite(bar.high - bar.low):
        a, b = x(bar.low), x(bar.high)
        whisker = f'<path class="whisker" d="M{a:.1f} {middle}H{b:.1f}M{a:.1f} {middle - 4}v8M{b:.1f} {middle - 4}v8"/>'
    return (
        f'<text x="{_LABELS - 8}" y="{middle + 4}" text-anchor="end">{escape(bar.label)}</text>'
        f'<rect class="{bar.style}" x="{_LABELS}" y="{y + 3}" height="{_ROW - 6}" '
        f'width="{x(bar.value) - _LABELS:.1f}"/>'
        f'{whisker}<text class="value" x="{WIDTH}" y="{middle + 4}" text-anchor="end">{escape(bar.text)}</text>'
    )


@dataclass(frozen=True, eq=False, slots=True)
class Map:
    """What a map shows, world frame, m.

    box        x from, x to, y from, y to
    posts      (P, 2) true objects, of a radius
    lines      class and points (M, 2) of each, as "reference", "estimate", "lost"
    points     class and points (M, 2) of each, drawn as dots
    ellipses   class, centres (L, 2) and covariances (L, 2, 2): 95 %
    view       outline (M, 2) of what the sensor could see, if shown
    texts      written at texts_at (T, 2)
    """

    title: str
    box: tuple[float, float, float, float]
    posts: Array
    radius: float
    lines: Sequence[tuple[str, Array]]
    points: Sequence[tuple[str, Array]] = ()
    ellipses: Sequence[tuple[str, Array, Array]] = ()
    view: Array = field(default_factory=lambda: np.empty((0, 2)))
    texts: Sequence[str] = ()
    texts_at: Array = field(default_factory=lambda: np.empty((0, 2)))


def chart(map_: Map, width: int = WIDTH) -> str:
    """The map with a grid of 5 m."""
    x0, x1, y0, y1 = map_.box
    scale = width / (x1 - x0)

    def at(xy: Array) -> Array:
        return np.column_stack([(xy[:, 0] - x0) * scale, (y1 - xy[:, 1]) * scale])

    parts = [_grid(map_.box, scale)]
    if len(map_.view):
        parts.append(f'<path class="view" d="{_path(at(map_.view))}Z"/>')
    for style, centres, covariances in map_.ellipses:
        around = ellipse_outline(centres, covariances, SIGMAS_95, 25)
        outlines = [_path(at(outline)) + "Z" for outline in around]
        parts.append(f'<path class="ellipse {style}" d="{"".join(outlines)}"/>')
    parts += [
        f'<circle class="post" cx="{x:.1f}" cy="{y:.1f}" r="{map_.radius * scale:.1f}"/>'
        for x, y in at(map_.posts)
    ]
    parts += [f'<path class="dots {style}" d="{_dots(at(xy))}"/>' for style, xy in map_.points]
    parts += [f'<path class="line {style}" d="{_path(at(xy))}"/>' for style, xy in map_.lines if len(xy) > 1]
    parts += [label(x, y, text) for text, (x, y) in zip(map_.texts, at(map_.texts_at), strict=True)]
    return svg(width, (y1 - y0) * scale, "".join(parts), map_.title)


def _grid(box: tuple[float, float, float, float], scale: float) -> str:
    x0, x1, y0, y1 = box
    right, bottom = (x1 - x0) * scale, (y1 - y0) * scale
    xs, ys = np.arange(5 * int(np.ceil(x0 / 5)), x1, 5), np.arange(5 * int(np.ceil(y0 / 5)), y1, 5)
    d = "".join(f"M{(x - x0) * scale:.1f} 0V{bottom:.1f}" for x in xs)
    d += "".join(f"M0 {(y1 - y) * scale:.1f}H{right:.1f}" for y in ys)
    ticks = "".join(
        f'<text class="tick" x="{(x - x0) * scale + 2:.1f}" y="{bottom - 3:.1f}">{x:.0f} m</text>'
        for x in xs
        if x >= 0
    )
    return f'<path class="grid" d="{d}"/>{ticks}'


def _path(xy: Array) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in xy)


def _dots(xy: Array) -> str:
    """A line of no length for each: round caps make dots of them."""
    return "".join(f"M{x:.1f} {y:.1f}h0" for x, y in xy)


def label(x: float, y: float, text: str) -> str:
    """A text whose middle is there."""
    return f'<text class="tick" x="{x:.1f}" y="{y:.1f}" text-anchor="middle">{escape(text)}</text>'


def svg(width: float, height: float, content: str, title: str, style: str = "drawing") -> str:
    """A drawing of this size, of a class of the style sheet, that says what it is."""
    return (
        f'<svg class="{style}" viewBox="0 0 {width:g} {height:.0f}" role="img" aria-label="{escape(title)}">'
        f"<title>{escape(title)}</title>{content}</svg>"
    )
