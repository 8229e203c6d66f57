"""The reference of the REST API from the server's own OpenAPI document."""

import json
from functools import cache
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from generated import cell, install, table

DEMO = Path(__file__).parents[2] / "app" / "demo" / "emulated-s1.mcap"
SHORT = 12  # lines: longer examples are folded
Json = dict[str, Any]


@cache
def document() -> Json:
    """What /openapi.json answers."""
    from lidarcore_app.web.server import ServerOptions, create_app

    with TemporaryDirectory() as folder:
        options = ServerOptions(recordings=Path(folder) / "recordings", recording=DEMO)
        openapi: Json = create_app(options).openapi()
    return openapi


def write() -> str:
    """Every route by its group: parameters, body, answers and an example."""
    routes = [
        (operation["tags"][0], f"{method.upper()} {path}", operation)
        for path, methods in document()["paths"].items()
        for method, operation in methods.items()
    ]
    order = list(dict.fromkeys(group for group, _, _ in routes))
    return "".join(
        f"## {group.capitalize()}\n\n"
        + "".join(_operation(name, operation) for _, name, operation in members)
        for group, members in groupby(sorted(routes, key=lambda r: order.index(r[0])), key=lambda r: r[0])
    )


def _operation(name: str, operation: Json) -> str:
    return (
        f"### `{name}`\n\n{_text(operation.get('description', ''))}\n\n"
        + _parameters(operation.get("parameters", []))
        + _body(operation.get("requestBody", {}))
        + "".join(_answer(status, answer) for status, answer in operation["responses"].items())
        + _errors(operation["responses"])
    )


def _parameters(parameters: list[Json]) -> str:
    rows = [
        (f"`{p['name']}`", p["in"], _type(p["schema"]), cell(p.get("description", ""))) for p in parameters
    ]
    return table(("parameter", "in", "type", "meaning"), rows)


def _body(body: Json) -> str:
    return "".join(
        f"Body: `{kind}`\n\n" + "".join(map(_json, content.get("schema", {}).get("examples", [])))
        for kind, content in body.get("content", {}).items()
    )


def _answer(status: str, answer: Json) -> str:
    if not status.startswith("2"):
        return ""
    kinds = ", ".join(f"`{kind}`" for kind in answer.get("content", {}))
    examples = [content["example"] for content in answer.get("content", {}).values() if "example" in content]
    return f"Answer {status}{': ' + kinds if kinds else ''}\n\n" + "".join(map(_json, examples))


def _errors(responses: Json) -> str:
    errors = sorted(status for status in responses if not status.startswith("2"))
    return f"Errors: {', '.join(errors)}\n\n" if errors else ""


def _type(schema: Json) -> str:
    """The type in a word or two: `number`, `one of json, csv`, ..., with the default."""
    if "enum" in schema:
        word = "one of " + ", ".join(map(str, schema["enum"]))
    elif "anyOf" in schema:
        word = " or ".join(_type(one) for one in schema["anyOf"] if one.get("type") != "null")
    elif schema.get("type") == "array":
        word = f"list of {_type(schema['items'])}"
    else:
        word = schema.get("type") or schema.get("$ref", "any").rpartition("/")[2]
    default = schema.get("default")
    return cell(word if default in (None, []) else f"{word}; {default}")


def _json(example: object) -> str:
    kind, text = (
        ("text", example.strip())
        if isinstance(example, str)
        else ("json", json.dumps(example, indent=2, ensure_ascii=False))
    )
    block = f"```{kind}\n{text}\n```\n\n"
    return (
        block if text.count("\n") < SHORT else f"<details><summary>Example</summary>\n\n{block}</details>\n\n"
    )


def _text(text: str) -> str:
    return text.replace("<", "&lt;").replace("*", "\\*")


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    return install(app, "rest", write)
