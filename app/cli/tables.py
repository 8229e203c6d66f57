"""Tables on the terminal."""

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from lidarcore.evaluation.intervals import Interval


def console(width: int) -> Console:
    """The terminal; a file or a pipe is as wide as the tables need."""
    terminal = Console()
    return terminal if terminal.is_terminal else Console(width=width)


def table(title: str | None, names: Sequence[str], figures: Sequence[str]) -> Table:
    """An empty table: columns of names, then columns of figures, which are flush right."""
    result = Table(title=title, title_justify="left")
    for heading in names:
        result.add_column(heading, no_wrap=True)
    for heading in figures:
        result.add_column(heading, justify="right")
    return result


def span(figure: Interval, digits: int) -> str:
    """A figure with its interval; nothing where there is none."""
    return "" if figure.value != figure.value else figure.span(digits)
