"""Which ellipses can be believed: judged by the coverage of the 95 % ellipse and how well the study knows it."""

import math
from collections.abc import Sequence
from itertools import groupby

from lidarcore.evaluation.consistency.design import KINDS
from lidarcore.evaluation.consistency.figures import HONEST, Verdict, within, wrong
from lidarcore.evaluation.consistency.study import Row
from lidarcore.evaluation.intervals import Interval
from lidarcore.lines import FITTERS

__all__ = ["Verdict", "sentences", "verdict"]


def verdict(coverage_95: Interval) -> Verdict:
    """Whether ellipses of this coverage can be believed; open if the interval reaches over an edge of HONEST.

    A study has trials enough to show that a coverage lies within HONEST. A window of scans has not: there
    `lidarcore.evaluation.repeatability.summary.verdict` is content with a wider band, and asks the 50 % ellipses, too.
    """
    return wrong(coverage_95, HONEST) or ("true" if within(coverage_95, HONEST) else "open")


def sentences(overall: Sequence[Row], by_room: Sequence[Row]) -> list[str]:
    """For one noise and segmentation: what can be believed in all rooms together, what not, and where rooms differ."""
    named = {(row.fitter, row.covariance): row for row in overall}
    texts = [
        f"{text}: {_list(chosen, told)}."
        for kind, text, told in _GROUPS
        if (chosen := [row for row in overall if _of(row) == kind])
    ]
    odd = [
        f"{_list([row], True)} in {row.room}"
        for row in by_room
        if _of(named[row.fitter, row.covariance]) == "true" and _of(row) in ("too small", "too large")
    ]
    if odd:
        texts.append(f"Believed in all rooms together, but not in each: {', '.join(odd)}.")
    return texts


_GROUPS: tuple[tuple[Verdict, str, bool], ...] = (
    ("true", "Can be believed", False),
    ("too small", "Not to be believed, the ellipses are too small", True),
    ("too large", "Not to be believed, the ellipses are too large", True),
    ("open", "Too few trials to tell", True),
)


def _of(row: Row) -> Verdict:
    return verdict(row.figures["coverage_95"])


def _list(rows: Sequence[Row], told: bool) -> str:
    """The methods, and how many of the corners their ellipses hold if that is to be told."""
    return ", ".join(
        _method(fitter, list(group), told) for fitter, group in groupby(rows, lambda row: row.fitter)
    )


def _method(fitter: str, rows: Sequence[Row], told: bool) -> str:
    title = FITTERS[fitter].title.split(",")[0]
    if len(rows) == len(KINDS) and not told:
        return f"{title} (both)"
    held = [_held(row) if told else "" for row in rows]
    return f"{title} {' and '.join(row.covariance + share for row, share in zip(rows, held, strict=True))}"


def _held(row: Row) -> str:
    share = row.figures["coverage_95"].value
    return f" {100 * share:.1f} %" if math.isfinite(share) else ", no corner found"
