"""Maps of landmarks as JSON, CSV and GeoJSON, always in metres and saying so.

Exchanged are the landmarks as they are; their history and the sessions stay in the database.
"""

import csv
import dataclasses
import json
import reprlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TextIO

from lidarcore.errors import LandmarkError, MapFileError
from lidarcore.files import reason, replacing
from lidarcore.files.json_reader import JsonReader
from lidarcore.files.streams import MAX_LINE
from lidarcore.files.texts import json_lines
from lidarcore.landmarks.landmark import COLUMNS, Landmark
from lidarcore.landmarks.landmark_map import LandmarkMap

Row = dict[str, Any]

_HEADER = {"format": "lidarcore landmarks", "version": 1, "unit": "m"}
_REQUIRED = {"x", "y", "var_x", "cov_xy", "var_y", "kind"}
_UNITS = {
    "x": "m",
    "y": "m",
    "var_x": "m2",
    "cov_xy": "m2",
    "var_y": "m2",
    "first_seen": "s",
    "last_seen": "s",
}
_CSV_NAMES = {name: f"{name}_{_UNITS[name]}" if name in _UNITS else name for name in COLUMNS}
_CSV_TYPES: dict[str, Callable[[str], Any]] = {"id": int, "count": int, **dict.fromkeys(_UNITS, float)}


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


def _write_csv(rows: Iterable[Row], file: TextIO) -> None:
    writer = csv.writer(file)
    writer.writerow(_CSV_NAMES.values())
    writer.writerows(row.values() for row in rows)


def _read_csv(file: TextIO) -> Iterator[Row]:
    reader = csv.reader(_lines(file), strict=True)
    header = next(filter(None, reader), None)
    if header is None:
        raise MapFileError("This CSV of landmarks is empty: export the map again, or give another file.")
    names = {csv_name: name for name, csv_name in _CSV_NAMES.items()}
    if unknown := [name for name in header if name not in names]:
        raise MapFileError(f"Columns {unknown} are unknown: rename and convert them to {list(names)}.")
    for values in filter(None, reader):  # without blank lines
        if len(values) != len(header):
            raise MapFileError(
                f"Line {reader.line_num} has {len(values)} values, the header {len(header)} columns: make them equal."
            )
        texts = dict(zip((names[name] for name in header), values, strict=True))
        yield {
            name: _CSV_TYPES.get(name, str)(text) for name, text in texts.items() if text or name == "method"
        }


def _lines(file: TextIO) -> Iterator[str]:
    while line := file.readline(MAX_LINE):
        if len(line) == MAX_LINE:
            raise MapFileError(
                f"A line is longer than {MAX_LINE} characters: this is not a table of landmarks."
            )
        yield line


def _write_json(rows: Iterable[Row], file: TextIO) -> None:
    file.writelines(json_lines(_HEADER, "landmarks", rows))


def _write_geojson(rows: Iterable[Row], file: TextIO) -> None:
    file.writelines(json_lines({"type": "FeatureCollection"} | _HEADER, "features", map(_feature, rows)))


def _read_geojson(file: TextIO) -> Iterator[Row]:
    for number, feature in enumerate(_items(file, "features"), 1):
        match feature:
            case {"geometry": {"type": "Point", "coordinates": [x, y, *_]}, "properties": dict(properties)}:
                pass
            case _:
                raise MapFileError(
                    f"Landmark {number} is no Point of two coordinates with properties: {json.dumps(feature)[:200]}"
                )
        if twice := {"x", "y"} & properties.keys():
            raise MapFileError(
                f"Landmark {number} has {', '.join(sorted(twice))} among its properties: leave it to the coordinates."
            )
        yield properties | {"x": x, "y": y} | ({"id": feature["id"]} if "id" in feature else {})


def _feature(row: Row) -> Row:
    properties = {name: value for name, value in row.items() if name not in ("id", "x", "y")}
    point = {"type": "Point", "coordinates": [row["x"], row["y"]]}
    return {"type": "Feature", "id": row["id"], "geometry": point, "properties": properties}


def _items(file: TextIO, key: str) -> Iterator[Row]:
    """The items of such a JSON object, if it is one of this format, version and unit."""
    reader, head = JsonReader(file), Row()
    if reader.next() != "{":
        reader.value()
        raise MapFileError(
            f"The file holds no object with the key {key}: export a map to see what is expected."
        )
    is_there = False
    for name in reader.members():
        if name == key:
            _check_head(head, {name: _HEADER[name] for name in head})
            is_there = True
            yield from _objects(reader, key)
        elif (value := reader.value()) is not None and name in _HEADER:
            head[name] = value
    if reader.next():
        raise MapFileError("There is more text after the end of the object: export the map again.")
    _check_head(head, _HEADER)
    if not is_there:
        raise MapFileError(f"{key} is not a list of objects.")


def _objects(reader: JsonReader, key: str) -> Iterator[Row]:
    items = reader.items() if reader.next() == "[" else [None]
    for item in items:
        if not isinstance(item, dict):
            raise MapFileError(f"{key} is not a list of objects.")
        yield item


def _check_head(head: Row, expected: Row) -> None:
    wrong = [
        f"{name} should be {value!r} and {_found(head.get(name))}"
        for name, value in expected.items()
        if head.get(name) != value
    ]
    if wrong:
        raise MapFileError(
            f"No map of landmarks begins so: {', '.join(wrong)}. Convert the file, or update lidarcore."
        )


def _found(value: object) -> str:
    return "is missing" if value is None else f"is {reprlib.repr(value)}"


@dataclass(frozen=True, slots=True)
class Format:
    """How rows of a landmark's fields are written to a text file and read back."""

    write: Callable[[Iterable[Row], TextIO], None]
    read: Callable[[TextIO], Iterable[Row]]


FORMATS = {
    "json": Format(_write_json, partial(_items, key="landmarks")),
    "csv": Format(_write_csv, _read_csv),
    "geojson": Format(_write_geojson, _read_geojson),
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
