"""A file of landmarks that somebody sent, read in a process of its own."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from itertools import islice
from pathlib import Path

from lidarcore.errors import MapFileError
from lidarcore.landmarks import Landmark, read_landmarks

from ..isolation import Isolated

_TOGETHER = 1000  # landmarks that come over at a time


def landmarks_of(path: Path, format: str) -> list[Landmark]:
    """The landmarks of a file (one of FORMATS), without ids. Raises MapFileError."""
    with closing(Isolated(f"the {format}", MapFileError, _read, path, format)) as reading:
        return [replace(landmark, id=None) for together in reading for landmark in together]


def _read(path: Path, format: str) -> Iterator[list[Landmark]]:
    with path.open(encoding="utf-8-sig", newline="") as text:
        found = read_landmarks(text, format)
        while together := list(islice(found, _TOGETHER)):
            yield together
