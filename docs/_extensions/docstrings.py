"""Docstrings as the project writes them, made into reStructuredText.

They are plain text: sentences, names in `backquotes`, tables of fields whose columns are aligned by spaces, and
sections in numpy's style. Settings are described where they are declared: their classes get that as a list.
"""

import re
from itertools import pairwise
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.ext.napoleon import Config, NumpyDocstring

FIELD = re.compile(r"^(\S(?:\S| (?! ))*?) {2,}(\S.*)$")  # a name, two spaces or more, what it is
UNDERLINE = re.compile(r"^\s*-{3,}\s*$")
SPECIAL = re.compile(r"([*|\\]|(?<=\w)_(?!\w))")
ARRAY = re.compile(r"ndarray\[tuple\[Any, \.\.\.\], dtype\[(\w+)\]\]")


def process(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Rewrite the lines of one docstring in place."""
    underlines = [i for i, line in enumerate(lines) if UNDERLINE.match(line)]
    end = underlines[0] - 1 if underlines else len(lines)
    text = _restructured(lines[:end])
    if what == "class":
        text += _settings(obj)
    if underlines:
        text += NumpyDocstring(lines[end:], Config(), app, what, name, obj, options).lines()
    lines[:] = text


def _restructured(lines: list[str]) -> list[str]:
    blocks: list[list[str]] = [[]]
    for line in lines:
        if line.strip():
            blocks[-1].append(line)
        elif blocks[-1]:
            blocks.append([])
    return [line for block in blocks if block for line in (*_block(block), "")]


def _block(block: list[str]) -> list[str]:
    if block[0].startswith(">>>"):
        return block
    if all(line.startswith("    ") for line in block) or _is_code(block):
        return ["::", "", *(f"    {line}" for line in block)]
    if FIELD.match(block[0]):
        return _fields(block)
    return [_escaped(line.strip()) for line in block]


def _is_code(block: list[str]) -> bool:
    """A line that ends with a colon and has an indented one below it."""
    return any(a.endswith(":") and b.startswith("    ") for a, b in pairwise(block)) and not FIELD.match(
        block[0]
    )


def _fields(block: list[str]) -> list[str]:
    """One item for each field: the first shows the column of the texts; other lines go with the field above."""
    first = FIELD.match(block[0])
    assert first
    column = first.start(2)
    items: list[str] = []
    for line in block:
        if not line.startswith(" ") and line[column - 1 : column] == " ":
            items.append(f"* **{_escaped(line[:column].strip())}**: {_escaped(line[column:].strip())}")
        else:
            items.append(f"  {_escaped(line.strip())}")
    return items


def _escaped(text: str) -> str:
    """The text without accidental markup; what stands in backquotes stays as it is."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(part if part.startswith("`") else SPECIAL.sub(r"\\\1", part) for part in parts)


def _settings(obj: Any) -> list[str]:
    """The fields of a class of settings: name, unit, default, meaning."""
    fields = getattr(obj, "__pydantic_fields__", {})
    described = {name: field for name, field in fields.items() if field.description}
    return [_setting(name, field) for name, field in described.items()] + [""] * bool(described)


def _setting(name: str, field: Any) -> str:
    unit = (
        (field.json_schema_extra or {}).get("unit", "") if isinstance(field.json_schema_extra, dict) else ""
    )
    default = "" if field.is_required() or field.default is None else f"{field.default} {unit}".strip()
    notes = f" ({_escaped(default or unit)})" if default or unit else ""
    return f"* **{name}**{notes}: {_escaped(field.description)}"


def shorten_arrays(app: Any, doctree: nodes.document) -> None:
    """`ndarray[tuple[Any, ...], dtype[float64]]` reads `NDArray[float64]`, in signatures and annotations."""
    kinds = (addnodes.desc_annotation, addnodes.desc_returns, addnodes.desc_sig_name)
    for node in list(doctree.findall(lambda node: isinstance(node, kinds))):
        text = node.astext()
        if ARRAY.search(text):
            node.children = []
            node += nodes.Text(ARRAY.sub(r"NDArray[\1]", text))


def sign_settings(
    app: Any, what: str, name: str, obj: Any, options: Any, signature: str | None, returns: str | None
) -> tuple[str, None] | None:
    """Settings are called by name; what each is stands in their list, not in the signature."""
    fields = getattr(obj, "__pydantic_fields__", None) if what == "class" else None
    return None if not fields else (f"({', '.join(map(_default, fields, fields.values()))})", None)


def _default(name: str, field: Any) -> str:
    if field.is_required():
        return name
    return f"{name}=..." if field.default_factory else f"{name}={field.default!r}"


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", process)
    app.connect("autodoc-process-signature", sign_settings)
    app.connect("doctree-read", shorten_arrays)
    return {"parallel_read_safe": True}
