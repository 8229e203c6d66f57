"""Landmarks as JSON and GeoJSON: one object, whose head says format, version and unit."""

import json
import reprlib
from collections.abc import Iterable, Iterator
from typing import TextIO

from lidarcore.errors import MapFileError
from lidarcore.files.json_reader import JsonReader
from lidarcore.files.texts import json_lines
from lidarcore.landmarks.landmark import Row

_HEADER = {"format": "lidarcore landmarks", "version": 1, "unit": "m"}


def write_json(rows: Iterable[Row], file: TextIO) -> None:
    """Write rows as the list `landmarks` of an object."""
    file.writelines(json_lines(_HEADER, "landmarks", rows))


def read_json(file: TextIO) -> Iterator[Row]:
    """The rows of a file that `write_json` wrote, unchecked. Raises MapFileError, ValueError."""
    return _items(file, "landmarks")


def write_geojson(rows: Iterable[Row], file: TextIO) -> None:
    """Write rows as a FeatureCollection of points, with what GeoJSON does not know beside it."""
    file.writelines(json_lines({"type": "FeatureCollection"} | _HEADER, "features", map(_feature, rows)))


def read_geojson(file: TextIO) -> Iterator[Row]:
    """The rows of a file that `write_geojson` wrote, unchecked. Raises MapFileError, ValueError."""
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
