"""Curves and box plots on a logarithmic axis, as SVG that is part of a page; its style sheet colours them."""

from collections.abc import Callable, Sequence
from html import escape

import numpy as np

from lidarcore.arrays import Array
from lidarcore.reporting.charts import WIDTH, label, svg

_LEFT, _BOTTOM, _TOP, _HEIGHT = 52, 34, 8, 240
_BOX = 26  # width of a box
_APART = 26  # of numbers below the axis, at least


def curves(
    x: Sequence[float], series: Sequence[tuple[str, Sequence[float]]], *, labels: tuple[str, str], title: str
) -> str:
    """Lines over x, both axes logarithmic, each of a class of the style sheet; labels of x and y."""
    high = max(max(values) for _, values in series)
    low = min(min(values) for _, values in series)
    y, frame = _log_axis(low, high, labels[1])
    at = _scale(min(x), max(x), _LEFT + 6, WIDTH - 14)
    parts = [frame]
    right = 0.0
    for value in x:
        if at(value) > right:
            parts.append(label(at(value), _HEIGHT - 18, f"{value:g}"))
            right = at(value) + _APART
    parts.append(label((_LEFT + WIDTH) / 2, _HEIGHT - 3, labels[0]))
    for style, values in series:
        points = "L".join(f"{at(a):.1f} {y(b):.1f}" for a, b in zip(x, values, strict=True))
        parts.append(f'<path class="line {style}" d="M{points}"/>')
    return svg(WIDTH, _HEIGHT, "".join(parts), title, "plot")


def boxes(
    groups: Sequence[tuple[str, str, Array]],
    *,
    unit: str,
    title: str,
    marks: Sequence[tuple[int, float]] = (),
) -> str:
    """Quartiles, median, whiskers of 1.5 times the interquartile range and outliers of (name, class, values).

    marks: number of a box and a value at which a dashed line is drawn across it.
    """
    all_values = np.concatenate([*(values for *_, values in groups), [value for _, value in marks]])
    y, frame = _log_axis(float(all_values.min()), float(all_values.max()), unit)
    step = (WIDTH - _LEFT) / len(groups)
    parts = [frame]
    for k, (name, style, values) in enumerate(groups):
        x = _LEFT + (k + 0.5) * step
        parts.append(_box(values, x, y, style))
        for n, line in enumerate(name.split("\n")):
            parts.append(label(x, _HEIGHT - 18 + 13 * n, line))
    for k, value in marks:
        x = _LEFT + (k + 0.5) * step
        parts.append(f'<path class="reference" d="M{x - _BOX:.1f} {y(value):.1f}h{2 * _BOX}"/>')
    return svg(WIDTH, _HEIGHT, "".join(parts), title, "plot")


def _box(values: Array, x: float, y: Callable[[float], float], style: str) -> str:
    q1, median, q3 = np.quantile(values, (0.25, 0.5, 0.75)).tolist()
    reach = 1.5 * (q3 - q1)
    inside = values[(values >= q1 - reach) & (values <= q3 + reach)]
    outliers = values[(values < q1 - reach) | (values > q3 + reach)]
    low, high = y(float(inside.min())), y(float(inside.max()))
    left, half = x - _BOX / 2, _BOX / 2
    dots = "".join(f"M{x:.1f} {y(value):.1f}h0" for value in outliers.tolist())
    return (
        f'<path class="whisker" d="M{x:.1f} {low:.1f}V{y(q1):.1f}M{x:.1f} {y(q3):.1f}V{high:.1f}'
        f'M{x - half / 2:.1f} {low:.1f}h{half:.1f}M{x - half / 2:.1f} {high:.1f}h{half:.1f}"/>'
        f'<rect class="{style}" x="{left:.1f}" y="{y(q3):.1f}" width="{_BOX}" '
        f'height="{max(y(q1) - y(q3), 1):.1f}"/>'
        f'<path class="whisker" d="M{left:.1f} {y(median):.1f}h{_BOX}"/><path class="dots {style}" d="{dots}"/>'
    )


def _log_axis(low: float, high: float, unit: str) -> tuple[Callable[[float], float], str]:
    """Where a value is, and a grid with numbers at 1, 2 and 5 times powers of ten."""
    low, high = low / 1.3, high * 1.3
    y = _scale(low, high, _HEIGHT - _BOTTOM, _TOP)
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))))
    steps = (1.0, 2.0, 5.0) if high / low < 200 else (1.0,)
    ticks = [step * 10.0**n for n in decades for step in steps if low <= step * 10.0**n <= high]
    grid = "".join(f"M{_LEFT} {y(value):.1f}H{WIDTH}" for value in ticks)
    numbers = "".join(
        f'<text class="tick" x="{_LEFT - 5}" y="{y(value) + 3:.1f}" text-anchor="end">{value:,g}</text>'
        for value in ticks
    )
    return (
        y,
        f'<path class="grid" d="{grid}"/>{numbers}<text class="tick" x="0" y="{_TOP + 4}">{escape(unit)}</text>',
    )


def _scale(low: float, high: float, first: float, last: float) -> Callable[[float], float]:
    return lambda value: first + (last - first) * float(np.log(value / low) / np.log(high / low))
