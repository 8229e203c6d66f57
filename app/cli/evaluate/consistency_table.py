"""A study of consistency on the terminal."""

from collections.abc import Iterable, Iterator
from itertools import groupby
from operator import attrgetter

from rich.table import Table

from lidarcore.evaluation.consistency.cells import COLUMNS, cell, noise_text
from lidarcore.evaluation.consistency.study import ALL_ROOMS, Consistency, Row
from lidarcore.evaluation.consistency.verdicts import verdict
from lidarcore.noise import SensorNoise

from ..tables import table

COLOURS = {"true": "green", "open": "yellow", "too small": "red", "too large": "red"}


def tables(study: Consistency, by_room: bool) -> Iterator[Table]:
    """A table for each segmentation, room (or all together) and noise."""
    key = attrgetter("segments", "room", "noise.sigma_range", "noise.sigma_bearing")
    rows = sorted(study.rows() if by_room else study.pooled(), key=key)
    for (segments, room, sigma_range, sigma_bearing), group in groupby(rows, key):
        rooms = ", ".join(study.design.rooms) if room == ALL_ROOMS else room
        noise = SensorNoise(sigma_range, sigma_bearing)
        yield _table(f"Noise {noise_text(noise)}; segments {segments}; {rooms}", group)


def _table(title: str, rows: Iterable[Row]) -> Table:
    result = table(title, ("fitter", "covariance"), [heading for heading, _, _ in COLUMNS.values()])
    for row in rows:
        cells = [cell(row.figures[name], factor, digits) for name, (_, factor, digits) in COLUMNS.items()]
        colour = COLOURS[verdict(row.figures["coverage_95"])]
        result.add_row(row.fitter, f"[{colour}]{row.covariance}[/]", *cells)
    return result
