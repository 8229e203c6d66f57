"""The documentation page: the OpenAPI document as HTML made here, so that it works without a network."""

import json
from html import escape
from typing import Any

from fastapi import APIRouter, Request
from starlette.responses import HTMLResponse

router = APIRouter(include_in_schema=False)

STYLE = """
:root { color-scheme: light dark; font: 16px/1.5 system-ui, sans-serif; }
body { max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
details { border: 1px solid #8884; border-radius: .4rem; margin: .5rem 0; padding: .4rem .8rem; }
summary { cursor: pointer; } summary b { display: inline-block; min-width: 4.5rem; }
code, pre { font: .85rem/1.4 ui-monospace, monospace; } pre { overflow: auto; max-height: 24rem; }
table { border-collapse: collapse; } td { padding: .15rem 1rem .15rem 0; vertical-align: top; }
"""
STREAM = """<h2>stream</h2><p>WebSocket <code>/api/v1/stream[?points=true]</code>, from the server only, JSON:
<code>{"type": "state", settings, source, selection, ready}</code> at first and after every change, and
<code>{"type": "frame", ...}</code> with the members of <code>/api/v1/frame</code>. A slow client gets fewer
frames, never old ones.</p>"""


@router.get("/docs")
def page(request: Request) -> HTMLResponse:
    """Every route with its parameters, bodies, answers and examples."""
    document = request.app.openapi()
    operations = [
        (operation["tags"][0], _operation(method.upper(), path, operation))
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    ]
    groups = dict.fromkeys(tag for tag, _ in operations)
    body = "".join(
        f"<h2>{escape(group)}</h2>" + "".join(html for tag, html in operations if tag == group)
        for group in groups
    )
    schemas = "".join(_schema(name, schema) for name, schema in document["components"]["schemas"].items())
    title = f"{escape(document['info']['title'])} {escape(document['info']['version'])}"
    return HTMLResponse(
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{title}: API</title>"
        f"<meta name=viewport content='width=device-width'><style>{STYLE}</style><h1>{title}</h1>"
        f"<p>{escape(document['info']['description'])} "
        f"The same for programs: <a href=openapi.json>openapi.json</a>. "
        f"Errors are problem details (RFC 9457).</p>{body}{STREAM}<h2>schemas</h2>{schemas}"
    )


def _operation(method: str, path: str, operation: dict[str, Any]) -> str:
    title, text = operation["summary"], operation.get("description", "")
    body = operation.get("requestBody", {}).get("content", {})
    return (
        f"<details><summary><b>{method}</b> <code>{escape(path)}</code> {escape(title)}</summary>"
        f"<p>{escape(text)}</p>{_parameters(operation.get('parameters', []))}"
        + "".join(f"<h4>Body: {escape(kind)}</h4>{_content(content)}" for kind, content in body.items())
        + "".join(_response(status, response) for status, response in operation["responses"].items())
        + "</details>"
    )


def _parameters(parameters: list[dict[str, Any]]) -> str:
    rows = "".join(
        f"<tr><td><code>{escape(p['name'])}</code><td>{p['in']}<td>{escape(p.get('description', ''))}"
        f"<td>{escape(_short(p['schema']))}"
        for p in parameters
    )
    return f"<table>{rows}</table>" if rows else ""


def _short(schema: dict[str, Any]) -> str:
    return ", ".join(f"{key}: {value}" for key, value in schema.items() if key in ("type", "enum", "default"))


def _response(status: str, response: dict[str, Any]) -> str:
    title = f"{status} {escape(response['description'])}"
    return "".join(
        f"<h4>{title} <small>{escape(kind)}</small></h4>{_content(content)}"
        for kind, content in response.get("content", {"": {}}).items()
    )


def _content(content: dict[str, Any]) -> str:
    """The example, wherever OpenAPI has it, and the name of the schema."""
    examples = content.get("schema", {}).get("examples", [])
    examples += [content["example"]] if "example" in content else []
    reference = content.get("schema", {}).get("$ref", "").rpartition("/")[2]
    named = f"<p>Schema <a href='#{reference}'>{reference}</a></p>" if reference else ""
    return named + "".join(_pre(example) for example in examples)


def _schema(name: str, schema: dict[str, Any]) -> str:
    return (
        f"<details id='{escape(name)}'><summary><code>{escape(name)}</code></summary>{_pre(schema)}</details>"
    )


def _pre(value: object) -> str:
    text = value if isinstance(value, str) else json.dumps(value, indent=2, ensure_ascii=False)
    return f"<pre>{escape(text)}</pre>"
