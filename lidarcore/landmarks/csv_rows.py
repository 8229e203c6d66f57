"""Landmarks as rows of CSV: a column for each field, whose name says its unit."""

import csv
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TextIO

from lidarcore.errors import MapFileError
from lidarcore.files.streams import MAX_LINE
from lidarcore.landmarks.landmark import COLUMNS, Row

_UNITS = {
    "x": "m",
    "y": "m",
    "var_x": "m2",
    "cov_xy": "m2",
    "var_y": "m2",
    "first_seen": "s",
    "last_seen": "s",
}
_NAMES = {name: f"{name}_{_UNITS[name]}" if name in _UNITS else name for name in COLUMNS}
_TYPES: dict[str, Callable[[str], Any]] = {"id": int, "count": int, **dict.fromkeys(_UNITS, float)}


def write_csv(rows: Iterable[Row], file: TextIO) -> None:
    """Write rows of COLUMNS to a text file, opened with newline=""."""
    writer = csv.writer(file)
    writer.writerow(_NAMES.values())
    writer.writerows(row.values() for row in rows)


def read_csv(file: TextIO) -> Iterator[Row]:
    """The rows of a text file, empty fields left out. Raises MapFileError, ValueError, csv.Error."""
    reader = csv.reader(_lines(file), strict=True)
    header = next(filter(None, reader), None)
    if header is None:
        raise MapFileError("This CSV of landmarks is empty: export the map again, or give another file.")
    names = {csv_name: name for name, csv_name in _NAMES.items()}
    if unknown := [name for name in header if name not in names]:
        raise MapFileError(f"Columns {unknown} are unknown: rename and convert them to {list(names)}.")
    for values in filter(None, reader):  # without blank lines
        if len(values) != len(header):
            raise MapFileError(
                f"Line {reader.line_num} has {len(values)} values, the header {len(header)} columns: make them equal."
            )
        texts = dict(zip((names[name] for name in header), values, strict=True))
        yield {name: _TYPES.get(name, str)(text) for name, text in texts.items() if text or name == "method"}


def _lines(file: TextIO) -> Iterator[str]:
    while line := file.readline(MAX_LINE):
        if len(line) == MAX_LINE:
            raise MapFileError(
                f"A line is longer than {MAX_LINE} characters: this is not a table of landmarks."
            )
        yield line
