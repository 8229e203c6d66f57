"""A study of consistency on the terminal."""

from collections.abc import Iterable, Iterator
from itertools import groupby
from operator import attrgetter

from rich.table import Table

from lidarcore.evaluation.consistency import ALL_ROOMS, Consistency, Row
from lidarcore.evaluation.intervals import Interval

COLUMNS = {
    "found": ("found", 1.0, 3),
    "bias": ("bias mm", 1e3, 2),
    "rms": ("RMS mm", 1e3, 2),
    "rms_ratio": ("RMS / bound", 1.0, 3),
    "coverage_50": ("in 50 %", 1.0, 3),
    "coverage_95": ("in 95 %", 1.0, 3),
    "coverage_99": ("in 99 %", 1.0, 3),
    "anees": ("ANEES", 1.0, 2),
    "area_ratio": ("area", 1.0, 3),
}
HONEST = (0.93, 0.97)  # coverage of a 95 % ellipse that can be believed


def tables(study: Consistency, by_room: bool) -> Iterator[Table]:
    """One for each segmentation, room (or all together) and noise."""
    key = attrgetter("segments", "room", "noise.sigma_range", "noise.sigma_bearing")
    rows = sorted(study.rows() if by_room else study.pooled(), key=key)
    for (segments, room, sigma_range, sigma_bearing), group in groupby(rows, key):
        rooms = ", ".join(study.design.rooms) if room == ALL_ROOMS else room
        noise = f"{100 * sigma_range:g} cm, {1e3 * sigma_bearing:g} mrad"
        yield _table(f"Noise {noise}; segments {segments}; {rooms}", group)


def _table(title: str, rows: Iterable[Row]) -> Table:
    table = Table(title=title, title_justify="left")
    for heading in ("fitter", "covariance"):
        table.add_column(heading, no_wrap=True)
    for heading, _, _ in COLUMNS.values():
        table.add_column(heading, justify="right")
    for row in rows:
        cells = [_cell(row.figures[name], factor, digits) for name, (_, factor, digits) in COLUMNS.items()]
        believed = HONEST[0] <= row.figures["coverage_95"].value <= HONEST[1]
        table.add_row(row.fitter, f"[{'green' if believed else 'red'}]{row.covariance}[/]", *cells)
    return table


def _cell(figure: Interval, factor: float, digits: int) -> str:
    """A figure and half of its interval; what may as well be 0 as its upper end."""
    low, value, high = (factor * x for x in (figure.low, figure.value, figure.high))
    if not low > 0:
        return f"< {high:.{digits}f}"
    return f"{value:.{digits}f} ±{(high - low) / 2:.{digits}f}".replace("±0.", "±.")
