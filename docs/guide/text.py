"""The guide's words, from a file: they hold no number but by name, and no picture but by name."""

import re
from collections.abc import Callable, Iterator, Mapping
from html import escape
from pathlib import Path

from lidarcore import reporting

WORDS = Path(__file__).with_name("guide.md")
_BESIDE = re.compile(r"!\[(\w+)\]\s*(.*)")


def sections(
    words: str, numbers: Mapping[str, object], pictures: Mapping[str, Callable[[], str]]
) -> Iterator[tuple[str, str]]:
    """Heading and HTML of each part; the first has no heading, and is the lead.

    Blocks are set apart by empty lines: `## part`, `### heading`, `- item`s, `![picture]`, alone or with words
    beside it, and paragraphs. Raises KeyError for a name that there is not.
    """
    heading, parts = "", list[str]()
    for block in re.split(r"\n\s*\n", words.strip()):
        text = block.format_map(numbers)
        if text.startswith("## "):
            yield heading, "".join(parts)
            heading, parts = text[3:], []
        else:
            parts.append(_block(text, pictures))
    yield heading, "".join(parts)


def _block(text: str, pictures: Mapping[str, Callable[[], str]]) -> str:
    if text.startswith("### "):
        return f"<h3>{escape(text[4:])}</h3>"
    if text.startswith("- "):
        return reporting.bullets([_line(item) for item in text[2:].split("\n- ")])
    shown = _BESIDE.fullmatch(_line(text))
    if shown is None:
        return reporting.paragraphs(_line(text))
    picture = pictures[shown[1]]()
    return _beside(shown[2], picture) if shown[2] else picture


def _line(text: str) -> str:
    return " ".join(text.split("\n"))


def _beside(words: str, drawing: str) -> str:
    """Words with a picture beside them, or below on a narrow screen."""
    return f'<div class="panels">{reporting.paragraphs(words)}<div style="max-width: 27rem">{drawing}</div></div>'
