"""Repeatability on the terminal."""

from collections.abc import Iterator, Sequence, Sized

from rich.table import Table

from lidarcore.evaluation.repeatability.summary import Box, Claim, Method, Summary, has_other_tails

from ..tables import span, table
from .consistency_table import COLOURS

MICRO = 1e6  # mm² in a m², mrad mm in a rad m


def tables(summary: Summary) -> Iterator[Table]:
    """A table of corners, areas in mm², and one of walls, areas of (alpha, r) in mrad mm."""
    corners = [(method, method.corners) for method in summary.methods]
    walls = [(method, method.walls) for method in summary.walls.methods]
    yield _table(f"Corners in the last {summary.scans} scans", "corners", "mm²", corners)
    yield _table(f"Walls, (alpha, r), in the last {summary.scans} scans", "walls", "mrad mm", walls)


def remarks(summary: Summary) -> Iterator[str]:
    """What is wrong, and what "neither" means where the tables have it."""
    yield from filter(None, dict.fromkeys((summary.message, summary.walls.message)))
    claims = (
        claim for method in (*summary.methods, *summary.walls.methods) for claim in method.claims.values()
    )
    if any(has_other_tails(claim.judgement) for claim in claims):
        yield (
            "neither: ellipses of 50 % and of 95 % are wrong in opposite ways, so that no size makes both true. The "
            "scatter has other tails than a Gaussian: see whether something moved; a calibration measures them."
        )


def _table(title: str, what: str, unit: str, methods: Sequence[tuple[Method, Sized]]) -> Table:
    claims = (what, "claimed", "quartiles", "scatter", "claimed / scatter, geometric mean")
    result = table(
        f"{title}: median one-sigma ellipse of a scan, and the scatter, {unit}",
        ("fitter", "covariance"),
        (*claims, "in 50 %", "in 95 %", "in 99 %"),
    )
    result.add_column("ellipses are", no_wrap=True)
    for method, features in methods:
        for kind, claim in method.claims.items():
            judged = claim.judgement
            figures = (judged.area_ratio, judged.coverage_50, judged.coverage_95, judged.coverage_99)
            result.add_row(
                method.name,
                kind,
                str(len(features)),
                *_box(claim.areas),
                "" if method.actual_area is None else f"{MICRO * method.actual_area:.2f}",
                *(span(figure, 2) for figure in figures),
                _verdict(claim),
            )
    return result


def _verdict(claim: Claim) -> str:
    if claim.verdict is None:
        return ""
    word = "neither" if has_other_tails(claim.judgement) else claim.verdict
    return f"[{COLOURS[claim.verdict]}]{word}[/]"


def _box(box: Box | None) -> tuple[str, str]:
    if box is None:
        return "", ""
    return f"{MICRO * box.median:.2f}", f"{MICRO * box.first_quartile:.2f}–{MICRO * box.third_quartile:.2f}"
