"""Pages of the reference are Markdown with a line `{{ name }}` where generated text goes."""

from collections.abc import Callable
from typing import Any


def install(app: Any, name: str, write: Callable[[], str]) -> dict[str, bool]:
    """Put what `write` returns into the page that has the placeholder of that name."""
    placeholder = "{{ " + name + " }}"

    def fill(app: Any, page: str, source: list[str]) -> None:
        if placeholder in source[0]:
            source[0] = source[0].replace(placeholder, write())

    app.connect("source-read", fill)
    return {"parallel_read_safe": True}


def cell(text: object) -> str:
    """Text that may stand in a cell of a Markdown table."""
    return str(text).replace("|", "\\|").replace("\n", " ").replace("<", "&lt;")


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """A Markdown table, with a blank line after it; nothing if it has no rows."""
    if not rows:
        return ""
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n\n"
