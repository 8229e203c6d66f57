"""Maps of landmarks as JSON, CSV and GeoJSON, always in metres and saying so.

Exchanged are the landmarks as they are; their history and the sessions stay in the database.
"""

import csv
import dataclasses
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from lidarcore.errors import LandmarkError, MapFileError
from lidarcore.files import reason, replacing
from lidarcore.landmarks.csv_rows import read_csv, write_csv
from lidarcore.landmarks.json_rows import read_geojson, read_json, write_geojson, write_json
from lidarcore.landmarks.landmark import COLUMNS, Landmark, Row
from lidarcore.landmarks.landmark_map import LandmarkMap

_REQUIRED = {"x", "y", "var_x", "cov_xy", "var_y", "kind"}


def export_map(landmark_map: LandmarkMap, path: str | Path) -> None:
    """Write all landmarks; the suffix (.json, .csv, .geojson) says the format. The file appears when complete.

    Raises MapFileError for another suffix or a file that cannot be written.
    """
    path = Path(path)
    name = _format(path)
    with (
        _explained(path.name),
        replacing(path) as partial,
        partial.open("w", encoding="utf-8", newline="") as file,
    ):
        write_landmarks(landmark_map, file, name)


def import_map(landmark_map: LandmarkMap, path: str | Path) -> list[int]:
    """Add the landmarks of a file under new ids; the ids.

    Nothing is changed unless every landmark is good. Raises MapFileError if the file cannot be read, is of another
    format, version or unit, or holds a landmark that makes no sense, which the message names.
    """
    path = Path(path)
    with _explained(path.name), path.open(encoding="utf-8-sig", newline="") as file:
        landmarks = list(read_landmarks(file, _format(path)))
    return landmark_map.put(dataclasses.replace(landmark, id=None) for landmark in landmarks)


def write_landmarks(landmarks: Iterable[Landmark], file: TextIO, name: str) -> None:
    """Write to a text file (opened with newline="") in one of FORMATS."""
    FORMATS[name].write(({column: getattr(mark, column) for column in COLUMNS} for mark in landmarks), file)


def read_landmarks(file: TextIO, name: str) -> Iterator[Landmark]:
    """Landmarks of a text file in one of FORMATS; raises MapFileError."""
    with _explained(f"This {name}"):
        for number, row in enumerate(FORMATS[name].read(file), 1):
            if wrong := (_REQUIRED - set(row)) | (set(row) - set(COLUMNS)):
                raise MapFileError(
                    f"Landmark {number} has missing or unknown fields: {', '.join(sorted(wrong))}."
                )
            try:
                yield Landmark(**row)
            except LandmarkError as error:
                raise MapFileError(f"Landmark {number}: {error}") from error


@dataclass(frozen=True, slots=True)
class Format:
    """How rows of a landmark's fields are written to a text file and read back."""

    write: Callable[[Iterable[Row], TextIO], None]
    read: Callable[[TextIO], Iterable[Row]]


FORMATS = {
    "json": Format(write_json, read_json),
    "csv": Format(write_csv, read_csv),
    "geojson": Format(write_geojson, read_geojson),
}


def _format(path: Path) -> str:
    name = path.suffix.lower().removeprefix(".")
    if name not in FORMATS:
        raise MapFileError(f"{path.name} should end in .{', .'.join(FORMATS)}, which says the format.")
    return name


@contextmanager
def _explained(what: str) -> Iterator[None]:
    try:
        yield
    except (OSError, ValueError, csv.Error, RecursionError) as error:
        raise MapFileError(f"{what} cannot be read or written: {reason(error)}.") from error
