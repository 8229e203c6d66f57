"""Reports of experiments: one HTML page each, complete in itself, by day and by night, on paper and on a phone."""

from collections.abc import Callable, Sequence
from html import escape
from pathlib import Path
from typing import Literal

Agreement = bool | None | Literal["not comparable"]
"""Whether a claim agrees with what was measured; None: open."""
NOT_COMPARABLE: Literal["not comparable"] = "not comparable"
_VERDICTS: dict[Agreement, tuple[str, str]] = {
    True: ("agrees", "agrees"),
    False: ("differs", "differs"),
    None: ("text", "open"),
    NOT_COMPARABLE: ("text", NOT_COMPARABLE),
}
"""CSS class and word."""
_STYLE = Path(__file__).with_suffix(".css")


def page(title: str, lead: str, sections: Sequence[tuple[str, str]]) -> str:
    """A page of sections: heading and HTML each."""
    body = "".join(f"<section><h2>{escape(heading)}</h2>{html}</section>" for heading, html in sections)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{_STYLE.read_text('utf-8')}</style></head>"
        f'<body><h1>{escape(title)}</h1><p class="lead">{escape(lead)}</p>{body}</body></html>\n'
    )


def paragraphs(*texts: str) -> str:
    """Plain paragraphs."""
    return "".join(f"<p>{escape(text)}</p>" for text in texts)


def bullets(texts: Sequence[str]) -> str:
    """A plain list."""
    return "<ul>" + "".join(f"<li>{escape(text)}</li>" for text in texts) + "</ul>"


def table(
    caption: str,
    headers: Sequence[str],
    rows: Sequence[Sequence[str]],
    texts: int = 1,
    style: Callable[[str], str] = lambda cell: "",
) -> str:
    """A table of numbers; the first `texts` columns are words; `style` gives the CSS class of a cell."""

    def cells(tag: str, row: Sequence[str]) -> str:
        return "".join(_cell(tag, cell, "text" if i < texts else style(cell)) for i, cell in enumerate(row))

    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return _wide(f"<caption>{escape(caption)}</caption><tr>{cells('th', headers)}</tr>{body}")


def verdicts(rows: Sequence[tuple[str, str, Agreement]]) -> str:
    """Claims beside what was measured, and whether it agrees."""
    body = "".join(
        f'<tr><td class="prose">{escape(claim)}</td><td class="prose">{escape(measured)}</td>'
        f'<td class="{_VERDICTS[agrees][0]}">{_VERDICTS[agrees][1]}</td></tr>'
        for claim, measured, agrees in rows
    )
    head = "".join(f'<th class="text">{name}</th>' for name in ("the paper says", "measured here", ""))
    return f'<table class="claims"><tr>{head}</tr>{body}</table>'


def figure(caption: str, panels: Sequence[tuple[str, str]], legend: Sequence[tuple[str, str]] = ()) -> str:
    """Panels (title, SVG) beside each other, a legend of names and CSS colours, and a caption."""
    keys = "".join(f'<span style="--of: {colour}">{escape(name)}</span>' for name, colour in legend)
    keys = f'<p class="legend">{keys}</p>' if keys else ""
    return f"<figure>{keys}{columns(panels)}<figcaption>{escape(caption)}</figcaption></figure>"


def columns(parts: Sequence[tuple[str, str]]) -> str:
    """Parts (title, HTML) beside each other where there is room."""
    drawn = "".join(f"<div>{f'<p>{escape(title)}</p>' if title else ''}{html}</div>" for title, html in parts)
    return f'<div class="panels">{drawn}</div>'


def details(summary: str, html: str) -> str:
    """HTML that is folded away until its summary is pressed."""
    return f"<details><summary>{escape(summary)}</summary>{html}</details>"


def _cell(tag: str, text: str, style: str) -> str:
    return f"<{tag}{f' class={style}' if style else ''}>{escape(text)}</{tag}>"


def _wide(rows: str) -> str:
    return f'<div class="wide" tabindex="0"><table>{rows}</table></div>'
