"""The reference of all settings, from the declarations that drive page, REST, files and command line."""

from collections.abc import Iterator
from typing import Any

from generated import cell, install, table

Json = dict[str, Any]


def write() -> str:
    """A table for each section of the settings."""
    from lidarcore_app.pipeline.settings import Settings

    schema = Settings.model_json_schema()
    return "".join(
        f"## {section}\n\n"
        + table(("setting", "unit", "default", "range", "meaning"), list(_rows(schema, part)))
        for section, part in schema["properties"].items()
    )


def _rows(schema: Json, part: Json, prefix: str = "") -> Iterator[tuple[str, ...]]:
    for name, field in _resolved(schema, part).get("properties", {}).items():
        inner = _resolved(schema, field)
        if "properties" in inner:
            yield from _rows(schema, inner, f"{prefix}{name}.")
        else:
            yield _row(prefix + name, inner)


def _row(name: str, field: Json) -> tuple[str, ...]:
    choices = field.get("enum") or field.get("items", {}).get("enum")
    default = field.get("default", "")
    if isinstance(default, list):
        default = ", ".join(map(str, default))
    return (
        f"`{name}`",
        cell(field.get("unit", "")),
        f"`{str(default).lower() if isinstance(default, bool) else default}`"
        if default not in ("", None)
        else "",
        cell(", ".join(map(str, choices)) if choices else _bounds(field)),
        cell(field.get("description", "")),
    )


def _bounds(field: Json) -> str:
    bounds = next((one for one in (field, *field.get("anyOf", [])) if _numbers(one)), {})
    return " ".join(_numbers(bounds))


def _numbers(field: Json) -> list[str]:
    signs = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
    return [f"{sign} {field[key]:g}" for key, sign in signs.items() if key in field]


def _resolved(schema: Json, part: Json) -> Json:
    """The part with what it refers to; what stands beside the reference wins."""
    reference = part.get("$ref") or next(
        (one["$ref"] for one in part.get("anyOf", []) if "$ref" in one), None
    )
    if reference is None:
        return part
    return {**schema["$defs"][reference.rpartition("/")[2]], **{k: v for k, v in part.items() if k != "$ref"}}


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    return install(app, "settings", write)
