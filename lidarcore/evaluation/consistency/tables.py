"""A study of consistency as a file: JSON or CSV, or a report in HTML."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from lidarcore import files
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.consistency.figures import FIGURES
from lidarcore.evaluation.consistency.report import html
from lidarcore.evaluation.consistency.study import Consistency, Row
from lidarcore.evaluation.intervals import LEVEL
from lidarcore.files.texts import csv_text, finite, json_text

FORMATS = (".json", ".csv")
STUDY_FORMATS = (*FORMATS, ".html")


def check(path: Path, formats: Sequence[str] = FORMATS) -> None:
    """Raises EvaluationError unless the file's name ends in one of the formats."""
    if path.name.lower() in ("", *formats):
        raise EvaluationError(f"The file to write has no name: give one, such as results{formats[0]}.")
    if path.suffix.lower() not in formats:
        raise EvaluationError(f"{path.name} should end in {' or '.join(formats)}: that decides the format.")


def write(study: Consistency, path: Path) -> None:
    """Write every row with every figure and the ends of its confidence interval; empty where there is none.

    The ending of the file's name, one of STUDY_FORMATS, decides the format; HTML is the report of it all.
    """
    check(path, STUDY_FORMATS)
    match path.suffix.lower():
        case ".json":
            text = to_json(study)
        case ".csv":
            text = to_csv(study.rows())
        case _:
            text = html(study)
    files.write(path, text)


def to_json(study: Consistency) -> str:
    """Design, figures with their units, and rows with [value, low, high] of each figure."""
    document = {
        "design": asdict(study.design),
        "trials": study.trials,
        "confidence": LEVEL,
        "figures": {figure.name: {"title": figure.title, "unit": figure.unit} for figure in FIGURES.values()},
        "rows": [
            _keys(row) | {name: [i.value, i.low, i.high] for name, i in row.figures.items()}
            for row in study.rows()
        ],
    }
    return json_text(document)


def to_csv(rows: Iterable[Row]) -> str:
    """A line for each row; columns figure, figure_low, figure_high in metres or without unit."""
    lines = [
        _keys(row)
        | {
            name + end: value
            for name, i in row.figures.items()
            for end, value in (("", i.value), ("_low", i.low), ("_high", i.high))
        }
        for row in rows
    ]
    return csv_text(finite(lines))


def _keys(row: Row) -> dict[str, Any]:
    return {
        "room": row.room,
        "sigma_range": row.noise.sigma_range,
        "sigma_bearing": row.noise.sigma_bearing,
        "segments": row.segments,
        "fitter": row.fitter,
        "covariance": row.covariance,
    }
