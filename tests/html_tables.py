"""Reports as a reader has them: the rows of their tables."""

from html.parser import HTMLParser


class Tables(HTMLParser):
    """The rows of cells of every table by its caption."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.rows: dict[str, list[list[str]]] = {}
        self._caption, self._tag = "", ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._tag = tag
        if tag == "caption":
            self._caption = ""
        elif tag == "tr":
            self.rows.setdefault(self._caption, []).append([])
        elif tag in ("td", "th"):
            self.rows[self._caption][-1].append("")

    def handle_data(self, data: str) -> None:
        if self._tag == "caption":
            self._caption += data
        elif self._tag in ("td", "th"):
            self.rows[self._caption][-1][-1] += data
