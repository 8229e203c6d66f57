"""Tables and documents as the texts of CSV and JSON files."""

import csv
import io
import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any


def csv_text(rows: Iterable[Mapping[str, Any]], columns: Iterable[str] | None = None) -> str:
    """A line for each row below a header: the columns, or the names in the first row; nothing where it has None."""
    lines, text = list(rows), io.StringIO()
    writer = csv.DictWriter(text, list(columns or lines[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return text.getvalue()


def json_text(document: Any) -> str:
    """A document as the text of a JSON file, with null for every number that is not finite."""
    return json.dumps(finite(document), indent=1, allow_nan=False) + "\n"


def json_lines(head: Mapping[str, Any], key: str, items: Iterable[Any]) -> Iterator[str]:
    """The text of a JSON object with one item of a list a line, piece by piece: the list may be long."""
    yield f"{json.dumps(head)[:-1]}, {json.dumps(key)}: ["
    separator = "\n"
    for item in items:
        yield separator + json.dumps(item, allow_nan=False)
        separator = ",\n"
    yield "\n]}\n"


def finite(document: Any) -> Any:
    """A document for JSON with None for every number that is not finite."""
    return json.loads(json.dumps(document), parse_constant=lambda _: None)
