"""Bars of a study of consistency: every method's figures with their intervals, beside what they should be."""

import math
from collections.abc import Sequence
from itertools import groupby

from lidarcore import reporting
from lidarcore.evaluation.consistency.cells import COLUMNS, cell
from lidarcore.evaluation.consistency.design import KINDS
from lidarcore.evaluation.consistency.figures import LEVELS
from lidarcore.evaluation.consistency.study import Row
from lidarcore.evaluation.consistency.trials import SEGMENTATIONS
from lidarcore.lines import FITTERS
from lidarcore.reporting import Bar, bars

STYLES = {"published": "m1", "consistent": "m0"}
LEGEND = [(kind, f"var(--{STYLES[kind]})") for kind in KINDS]
SEGMENTS = {"known": "segments known", "found": "real segmentation"}

_LOG_ROOM = 1.5  # below the least value on a logarithmic axis
_BY_KIND = ("anees", "area_ratio")  # ratios that are 1 if the claim is true
_BY_FITTER = ("rms_ratio", "bias")  # of the estimates, whatever is claimed of them


def coverages(rows: Sequence[Row]) -> str:
    """A panel for each level and segmentation: shares of corners in the ellipse; dashed: as many as there should be."""
    panels = [
        _panel(group, f"coverage_{100 * level:.0f}", f"in the {100 * level:.0f} % ellipse", level)
        for group in _by_segments(rows)
        for level in LEVELS
    ]
    caption = (
        "Share of the corners that are inside their ellipse, and its 95 % confidence interval. Dashed: what it "
        "should be."
    )
    return reporting.figure(caption, panels, LEGEND)


def ratios(rows: Sequence[Row]) -> str:
    """A panel for each figure that should be 1, and each segmentation."""
    panels = [
        panel
        for group in _by_segments(rows)
        for panel in (
            _panel(group, "anees", "ANEES (log)", 1.0),
            _panel(group, "area_ratio", "claimed / actual area (log)", 1.0),
            _panel(group, "rms_ratio", "RMS error / bound", 1.0),
        )
    ]
    caption = (
        "Normalised squared errors (ANEES) and ellipse areas, 1 if the claim is true; RMS errors over the "
        "Cramér-Rao bound, 1 for the best that is possible, whatever is claimed. Dashed: 1."
    )
    return reporting.figure(caption, panels, LEGEND)


def biases(rows: Sequence[Row]) -> str:
    """A panel for each segmentation."""
    panels = [_panel(group, "bias", "bias, mm", None) for group in _by_segments(rows)]
    caption = "Bias: the error that stays the same from scan to scan of a place. No covariance holds it."
    return reporting.figure(caption, panels)


def _by_segments(rows: Sequence[Row]) -> list[list[Row]]:
    return [group for s in SEGMENTATIONS if (group := [row for row in rows if row.segments == s])]


def _panel(rows: Sequence[Row], name: str, title: str, mark: float | None) -> tuple[str, str]:
    title = f"{title}, {SEGMENTS[rows[0].segments]}"
    drawn = _bars(rows, name)
    values = [bar.value for bar in drawn if isinstance(bar, Bar) and bar.value > 0]
    highs = [bar.high for bar in drawn if isinstance(bar, Bar) and math.isfinite(bar.high)]
    if name.startswith("coverage"):
        return title, bars(drawn, 1.0, title=title, mark=mark)
    most = max([1.0, *values, *highs])
    least = min([1.0, *values]) / _LOG_ROOM if name in _BY_KIND else None
    return title, bars(drawn, most, title=title, least=least, mark=mark)


def _bars(rows: Sequence[Row], name: str) -> list[Bar | str]:
    """A heading for each fitter; a bar for each kind of covariance, or one where they do not matter."""
    drawn: list[Bar | str] = []
    for fitter, group in groupby(rows, lambda row: row.fitter):
        drawn.append(FITTERS[fitter].title)
        if name in _BY_FITTER:
            drawn.append(_bar(next(group), name, "estimate", "m2"))
        else:
            drawn += [_bar(row, name, row.covariance, STYLES[row.covariance]) for row in group]
    return drawn


def _bar(row: Row, name: str, label: str, style: str) -> Bar:
    _, factor, digits = COLUMNS[name]
    figure = row.figures[name]
    text = cell(figure, factor, digits)
    if not math.isfinite(figure.value):  # no corner was found
        return Bar(label, 0.0, math.nan, math.nan, text, style)
    return Bar(label, factor * figure.value, factor * figure.low, factor * figure.high, text, style)
