"""Files that are whole or not there."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A file beside the path that takes its place at the end, or goes away if something fails."""
    partial = path.with_name(f".{path.name}.part")
    try:
        yield partial
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def write(path: Path, text: str) -> None:
    """Write a text file, UTF-8 and its line ends as they are, that appears when complete. Raises OSError."""
    with replacing(path) as partial:
        partial.write_text(text, "utf-8", newline="")
