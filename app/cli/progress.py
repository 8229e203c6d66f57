"""How far a long command is: a bar on the terminal, or lines for the program that has started it."""

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from typing import TYPE_CHECKING, Annotated

import typer

from ..jobs.command_process import PROGRESS

if TYPE_CHECKING:
    from rich.progress import ProgressColumn

ForPrograms = Annotated[
    bool,
    typer.Option(
        "--progress",
        help=f"for programs: lines '{PROGRESS} DONE TOTAL' on stderr, 0 if nobody knows; ends with its standard input",
    ),
]


@contextmanager
def progress(total: int, for_programs: bool = False) -> Iterator[Callable[[int], None]]:
    """Call what it gives with the number of parts that are done."""
    from rich.progress import MofNCompleteColumn, TimeElapsedColumn, TimeRemainingColumn

    bar = _bar(total, MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with _lines(total) if for_programs else bar as tell:
        yield tell


@contextmanager
def counted(total: int, for_programs: bool = False) -> Iterator[Callable[[], None]]:
    """Call what it gives after each of the parts."""
    with progress(total, for_programs) as tell:
        numbers = count(1)
        yield lambda: tell(next(numbers))


@contextmanager
def counting(what: str, for_programs: bool = False) -> Iterator[Callable[[int], None]]:
    """Call what it gives with the number of them so far, where nobody knows how many there will be."""
    from rich.progress import TextColumn, TimeElapsedColumn

    bar = _bar(None, TextColumn(f"{{task.completed}} {what}"), TimeElapsedColumn())
    with _lines(0) if for_programs else bar as tell:
        yield tell


@contextmanager
def _lines(total: int) -> Iterator[Callable[[int], None]]:
    threading.Thread(target=_end_with_input, name="input", daemon=True).start()

    def tell(done: int) -> None:
        print(PROGRESS, done, total, file=sys.stderr, flush=True)

    tell(0)
    yield tell


def _end_with_input() -> None:
    """Whoever has started this holds the other end; where it is closed, nobody waits for the result any more."""
    while os.read(0, 4096):  # not sys.stdin, which cannot be closed while a thread reads it
        pass
    os._exit(1)


@contextmanager
def _bar(total: int | None, *columns: "ProgressColumn") -> Iterator[Callable[[int], None]]:
    """A bar, and what else is to be told of it, if there is a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress

    console = Console(stderr=True)
    with Progress(
        BarColumn(), *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("", total=total)
        yield lambda done: bar.update(task, completed=done)
