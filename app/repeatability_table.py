"""Repeatability on the terminal."""

from rich.table import Table

from app.consistency_table import COLOURS
from lidarcore.evaluation.intervals import Interval
from lidarcore.evaluation.repeatability_summary import Box, Summary

MM2 = 1e6


def table(summary: Summary) -> Table:
    result = Table(
        title=f"The last {summary.scans} scans: median one-sigma ellipse of a scan, and the scatter, mm²",
        title_justify="left",
    )
    for heading in ("fitter", "covariance"):
        result.add_column(heading, no_wrap=True)
    for heading in (
        "corners", "claimed", "quartiles", "scatter", "claimed / scatter", "in 50 %", "in 95 %", "in 99 %",
    ):  # fmt: skip
        result.add_column(heading, justify="right")
    result.add_column("ellipses are", no_wrap=True)
    for method in summary.methods:
        for kind, claim in method.claims.items():
            judged = claim.judgement
            result.add_row(
                method.name,
                kind,
                str(len(method.corners)),
                *_box(claim.areas),
                "" if method.actual_area is None else f"{MM2 * method.actual_area:.2f}",
                *map(_cell, (judged.area_ratio, judged.coverage_50, judged.coverage_95, judged.coverage_99)),
                "" if claim.verdict is None else f"[{COLOURS[claim.verdict]}]{claim.verdict}[/]",
            )
    return result


def _box(box: Box | None) -> tuple[str, str]:
    if box is None:
        return "", ""
    return f"{MM2 * box.median:.2f}", f"{MM2 * box.first_quartile:.2f}–{MM2 * box.third_quartile:.2f}"


def _cell(figure: Interval) -> str:
    if figure.value != figure.value:
        return ""
    return f"{figure.value:.2f} ({figure.low:.2f}–{figure.high:.2f})"
