"""The OpenAPI document: what FastAPI tells of the routes, with problems as they are and an example of each answer.

The examples are in examples.json, each once, by the name of its schema, or by method and path where that is not enough;
{"$ref": name} stands for another one. The tests check that each is what its schema says.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fastapi import FastAPI

from .problems import ProblemJson, documented

MEDIA_TYPES = {
    "json": "application/json",
    "csv": "text/csv",
    "geojson": "application/geo+json",
    "png": "image/png",
    "svg": "image/svg+xml",
    "dxf": "image/vnd.dxf",
    "zip": "application/zip",
}
_EXAMPLES: dict[str, Any] = json.loads(Path(__file__).with_name("examples.json").read_text("utf-8"))


def example(name: str) -> Any:
    """The example of that schema. Raises KeyError."""
    return _complete(_EXAMPLES[name])


def formats(**examples: object) -> dict[int | str, dict[str, Any]]:
    """The OpenAPI entry of the formats of an answer that its schema does not tell of, csv=..., with their examples."""
    return {200: {"content": {MEDIA_TYPES[name]: {"example": sample} for name, sample in examples.items()}}}


def document(app: FastAPI) -> None:
    """Add what FastAPI does not know to the app's document: problem details, null in intervals, and examples."""
    describe = app.openapi

    def openapi() -> dict[str, Any]:
        description = describe()
        schemas = description["components"]["schemas"]
        schemas["ProblemJson"] = ProblemJson.model_json_schema()
        for number in schemas["Interval"]["properties"].values():  # NaN, where there is nothing to make it of
            number.pop("type", None)
            number["anyOf"] = [{"type": "number"}, {"type": "null"}]
        for path, operations in description["paths"].items():
            for method, operation in operations.items():
                if "requestBody" in operation:
                    operation["responses"].setdefault("400", documented(400)[400])
                for answer in _answers(operation):
                    _add_example(answer, f"{method} {path}")
        return description

    app.openapi = openapi  # type: ignore[method-assign]


def _answers(operation: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """What an operation answers with in JSON when all is well."""
    for status, response in operation["responses"].items():
        if status.startswith("2") and "application/json" in response.get("content", ()):
            yield response["content"]["application/json"]


def _add_example(answer: dict[str, Any], operation: str) -> None:
    schema = answer.get("schema", {})
    name = schema.get("items", schema).get("$ref", "").rpartition("/")[2]
    if (key := operation if operation in _EXAMPLES else name) in _EXAMPLES:
        answer.setdefault("example", [example(key)] if "items" in schema else example(key))


def _complete(node: Any) -> Any:
    """A part of an example, with others in their places."""
    if isinstance(node, dict):
        if "$ref" in node:
            return example(node["$ref"])
        return {name: _complete(member) for name, member in node.items()}
    return [_complete(item) for item in node] if isinstance(node, list) else node
