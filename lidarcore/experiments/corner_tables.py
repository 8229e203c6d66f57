"""Tables and maps of corners for the reports: what is claimed, what scatters, what is possible."""

from collections.abc import Mapping, Sequence

import numpy as np

from lidarcore import reporting
from lidarcore.arrays import Array
from lidarcore.evaluation.consistency.design import KINDS
from lidarcore.experiments.claim_rules import in_words
from lidarcore.experiments.corner_study import CornerStudy
from lidarcore.experiments.environments import Environment
from lidarcore.lines import FITTERS
from lidarcore.reporting import Map, chart
from lidarcore.reporting.charts import SIGMAS_95

SCALE = 10  # of the ellipses in maps, as in [WCTLS, Fig. 3]
_MARGIN = 0.6  # m


def sigmas(environment: Environment, fitters: Sequence[str], number: str) -> str:
    """The paper's table of standard deviations, with the true scatter and the least possible beside them, mm."""
    study, what = environment.study, f"Table {number}. " if environment.room else ""
    columns: dict[str, Array] = {}
    for name in fitters:
        title = _short(name)
        columns[f"{title} published"] = study.claimed(name, "published")
        columns[f"{title} consistent"] = study.claimed(name, "consistent")
        columns[f"{title} scatter"] = study.scatter(name)
    if study.bounds is not None:
        columns["least possible"] = study.bound
    headers = ["corner", *(f"{title} {axis}" for title in columns for axis in ("σx", "σy"))]
    values = 1e3 * np.column_stack(list(columns.values()))
    numbers = [str(number) for number in range(1, len(values) + 1)]
    rows = [
        [number, *(f"{value:.1f}" for value in row)]
        for number, row in zip([*numbers, "mean"], [*values, values.mean(axis=0)], strict=True)
    ]
    caption = f"{what}Standard deviations of the corners of {environment.name}, mm"
    return reporting.table(caption, headers, rows)


def honesty(environment: Environment, fitters: Sequence[str]) -> str:
    """Coverage and errors of every fitter, and of ml in a room, with segments known and with those that are found."""
    fitters = (*fitters, *(("ml",) if environment.room else ()))
    studies: list[tuple[str, CornerStudy]] = [("known" if environment.found else "found", environment.study)]
    if environment.found is not None:
        studies.append(("found", environment.found))
    rows = [
        [
            FITTERS[name].title,
            segments,
            in_words(study.found(name), 100),
            study.rms_ratio(name, fitters[0]).span(3, to=" to "),
            "" if study.bounds is None else f"{100 * study.bias(name):.0f}",
            *(in_words(study.coverage(name, kind), 100) for kind in KINDS),
            *(f"{1e6 * np.median(study.scan_areas(name, kind)):.0f}" for kind in KINDS),
            f"{1e6 * study.actual_area(name):.0f}",
        ]
        for segments, study in studies
        for name in fitters
    ]
    headers = (
        "method", "segments", "corners found, %", f"RMS error / {_short(fitters[0])}", "bias / RMS error, %",
        "in the published 95 % ellipse, %", "in the consistent one, %",
        "published area, mm²", "consistent area, mm²", "true area, mm²",
    )  # fmt: skip
    caption = f"Coverage, errors and median ellipse areas, {environment.name}"
    return reporting.table(caption, headers, rows, texts=2)


def maps(environment: Environment, styles: Mapping[str, str], number: str = "", remark: str = "") -> str:
    """A figure of two panels: ellipses as published and as they truly are, SCALE times as large; classes by fitter."""
    name = environment.name[0].upper() + environment.name[1:]
    caption = (
        f"{number}{name}. One-sigma ellipses, drawn {SCALE} times as large{remark}; the green dot is the sensor, "
        "corners are numbered clockwise."
    )
    return reporting.figure(caption, _maps(environment, styles), legend(styles))


def _maps(environment: Environment, styles: Mapping[str, str]) -> list[tuple[str, str]]:
    study = environment.study
    points, corners = environment.points, study.corners
    low, high = points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN
    numbers = [str(number) for number in range(1, len(corners) + 1)]
    panels = []
    for what, of in (
        ("published", lambda name: study.claims(name, "published")),
        ("true scatter", study.scattered),
    ):
        title = f"{environment.name}: {what}, {SCALE} times as large"
        drawn = Map(
            title, (low[0], high[0], low[1], high[1]), np.empty((0, 2)), 0.0, [],
            [("scan", points), ("seen", np.zeros((1, 2)))],
            [(style, corners, (SCALE / SIGMAS_95) ** 2 * of(name)) for name, style in styles.items()],
            texts=numbers, texts_at=_aside(corners),
        )  # fmt: skip
        panels.append((title, chart(drawn, 560)))
    return panels


def _aside(corners: Array) -> Array:
    """Places for the numbers of corners: a little farther from the sensor, where they do not hide corners."""
    return corners * (1 + 0.35 / np.linalg.norm(corners, axis=1, keepdims=True))


def methods(fitters: Sequence[str]) -> str:
    """What the fitters are, and where they are from."""
    return f"Methods: {'; '.join(f'{FITTERS[name].title}: {FITTERS[name].reference}' for name in fitters)}."


def legend(styles: Mapping[str, str]) -> list[tuple[str, str]]:
    """Names of fitters and their colours."""
    return [(FITTERS[name].title, f"var(--{style})") for name, style in styles.items()]


def _short(fitter: str) -> str:
    return FITTERS[fitter].title.split(",")[0]
