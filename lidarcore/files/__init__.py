"""Files that are whole or not there."""

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import count
from pathlib import Path

from lidarcore.files.reasons import reason

__all__ = ["partials", "reason", "replacing", "replacing_all", "write"]

_NUMBERS = count()


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A file beside the path that takes its place at the end, or goes away if something fails.

    Its name is of its own, so that several may write the same file at once; the last one to end stays.
    """
    with replacing_all(path) as (part,):
        yield part


def partials(folder: Path, name: str) -> Iterator[Path]:
    """What those that were killed while they wrote files of that name, a glob pattern, have left."""
    return folder.glob(f".{name}.*-*.part")


def write(path: Path, text: str) -> None:
    """Write a text file, UTF-8 and its line ends as they are, that appears when complete. Raises OSError."""
    with replacing(path) as partial:
        partial.write_text(text, "utf-8", newline="")


@contextmanager
def replacing_all(*paths: Path) -> Iterator[list[Path]]:
    """Files beside the paths that take their places once all are written, or go away if anything fails."""
    with ExitStack() as stack:
        parts = [path.with_name(f".{path.name}.{os.getpid()}-{next(_NUMBERS)}.part") for path in paths]
        for part in parts:
            stack.callback(part.unlink, missing_ok=True)
        yield parts
        for part, path in zip(parts, paths, strict=True):
            part.replace(path)
