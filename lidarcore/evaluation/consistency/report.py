"""The report of a study of consistency: which ellipses can be believed, and every figure that says so."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict

from lidarcore import reporting
from lidarcore.evaluation.consistency.cells import COLUMNS, cell, noise_text
from lidarcore.evaluation.consistency.figures import HONEST
from lidarcore.evaluation.consistency.plots import SEGMENTS, biases, coverages, ratios
from lidarcore.evaluation.consistency.study import Consistency, Row
from lidarcore.evaluation.consistency.trials import Segmentation
from lidarcore.evaluation.consistency.verdicts import Verdict, sentences, verdict
from lidarcore.evaluation.intervals import Interval
from lidarcore.lines import FITTERS
from lidarcore.noise import SensorNoise
from lidarcore.settings import Covariance

TITLE = "Which ellipses can be believed?"
TOGETHER = "all rooms together"
BELIEVED = "Coverage of the 95 % ellipse, %, and whether it can be believed"
_VERDICTS: dict[Verdict, tuple[str, str]] = {
    "true": ("yes", "yes"),
    "too small": ("too small", "no"),
    "too large": ("too large", "no"),
    "open": ("open", ""),
}


def html(study: Consistency) -> str:
    """The report as one page that needs nothing else."""
    noises = "; ".join(noise_text(noise) for noise in study.design.noises)
    lead = (
        "Every method claims an ellipse around each corner. Here the true corners are known: they are simulated, "
        f"{study.trials:,} times, each estimated by {len(FITTERS)} methods. So the claims can be held against what is "
        f"so. Noise of range and bearing: {noises}."
    )
    overall = list(study.pooled())
    by_room = list(study.rows()) if len(study.design.rooms) > 1 else []
    sections = [
        (TITLE, reporting.paragraphs(_criterion()) + _summary(overall, by_room)),
        *(
            (f"Noise {noise_text(noise)}", _of_noise(study, noise, _at(overall, noise), _at(by_room, noise)))
            for noise in study.design.noises
        ),
        ("What the figures are", reporting.bullets(_MEANINGS)),
        ("How this was made", reporting.bullets(_set_up(study))),
    ]
    return reporting.page("Consistency of the methods' covariances", lead, sections)


def _criterion() -> str:
    least, most = (f"{100 * x:g}" for x in HONEST)
    return (
        "A 95 % ellipse should hold the true corner in 95 of 100 scans. Its ellipses can be believed if a method's "
        f"coverage lies within {least} to {most} % with its whole 95 % confidence interval, and cannot if the whole "
        "interval is outside. What is neither needs more trials."
    )


def _at(rows: Iterable[Row], noise: SensorNoise) -> list[Row]:
    return [row for row in rows if row.noise == noise]


def _summary(overall: Sequence[Row], by_room: Sequence[Row]) -> str:
    """What can be believed: a table for each segmentation, then for every noise in words."""
    segmentations = list(dict.fromkeys(row.segments for row in overall))
    noises = list(dict.fromkeys(row.noise for row in overall))
    tables = "".join(_believed([row for row in overall if row.segments == s], noises) for s in segmentations)
    return tables + "".join(
        f"<h3>Noise {noise_text(noise)}</h3>"
        + reporting.columns([_words(_at(overall, noise), _at(by_room, noise), s) for s in segmentations])
        for noise in noises
    )


def _words(overall: Sequence[Row], by_room: Sequence[Row], segments: Segmentation) -> tuple[str, str]:
    chosen = ([row for row in rows if row.segments == segments] for rows in (overall, by_room))
    return SEGMENTS[segments], reporting.bullets(sentences(*chosen))


def _believed(rows: Sequence[Row], noises: Sequence[SensorNoise]) -> str:
    """A row for each method, a column for each noise."""
    methods = dict.fromkeys((row.fitter, row.covariance) for row in rows)
    cells = {(row.fitter, row.covariance, row.noise): _judged(row.figures["coverage_95"]) for row in rows}
    table = [[*_method(*method), *(cells[*method, noise] for noise in noises)] for method in methods]
    headers = ["method", "covariance", *map(noise_text, noises)]
    caption = f"{BELIEVED}: {SEGMENTS[rows[0].segments]}"
    return reporting.table(caption, headers, table, texts=2, style=_style)


def _judged(coverage: Interval) -> str:
    return f"{cell(coverage, 100, 1)} {_VERDICTS[verdict(coverage)][0]}"


def _style(text: str) -> str:
    return next((style for word, style in _VERDICTS.values() if text.endswith(word)), "")


def _method(fitter: str, covariance: Covariance) -> tuple[str, str]:
    return FITTERS[fitter].title, covariance


def _of_noise(study: Consistency, noise: SensorNoise, overall: Sequence[Row], by_room: Sequence[Row]) -> str:
    rooms = study.design.rooms
    if not by_room:
        return _figures(f"{noise_text(noise)}; {rooms[0]}", overall)
    each = (
        reporting.details(
            f"{room} alone", _figures(f"{noise_text(noise)}; {room}", [r for r in by_room if r.room == room])
        )
        for room in rooms
    )
    return _figures(f"{noise_text(noise)}; {TOGETHER}", overall) + "".join(each)


def _figures(what: str, rows: Sequence[Row]) -> str:
    headers = ["method", "covariance", "segments", *(heading for heading, _, _ in COLUMNS.values())]
    cells = [
        [
            *_method(row.fitter, row.covariance),
            row.segments,
            *(cell(row.figures[name], factor, digits) for name, (_, factor, digits) in COLUMNS.items()),
        ]
        for row in rows
    ]
    return (
        coverages(rows)
        + ratios(rows)
        + biases(rows)
        + reporting.table(f"Every figure: {what}", headers, cells, texts=3)
    )


_MEANINGS = [
    "In 50, 95, 99 %: share of the corners that lie within the ellipse of that probability. ±: half of the 95 % "
    "confidence interval; where it reaches 0, its upper end stands alone.",
    "RMS / bound: RMS error over the Cramér-Rao bound, the least that an unbiased method can have with segments known.",
    "ANEES: mean of the squared error measured in claimed standard deviations, over the dimension. Above 1 the "
    "method claims too much, below 1 too little.",
    "Area: of the claimed ellipse over that of the actual one, made of the true errors.",
    "Bias: the part of the error that stays the same from scan to scan of one place. No covariance holds it.",
    "Published is the covariance the method's paper gives; consistent is exact to first order for the noise of the "
    "sensor. The estimates are the same.",
]


def _set_up(study: Consistency) -> list[str]:
    design = asdict(study.design)
    return [
        f"Rooms: {', '.join(study.design.rooms)}; sensor at random places. {design['beams']} beams a scan, "
        f"{design['draws']} scans from each place, {design['blocks']} independent blocks of trials for each room and "
        f"noise, of which the intervals are made. Seed {design['seed']}: the same command gives the same numbers.",
        "Every method is told the noise that there is. Segments known: every beam is of the wall it truly met, so that "
        "the formulas alone are judged. Real segmentation: as in live view, where points may go to the wrong wall; a "
        "corner counts if most beams of its two segments met its two walls.",
        "Methods: " + "; ".join(f"{fitter.title}: {fitter.reference}" for fitter in FITTERS.values()) + ".",
    ]
