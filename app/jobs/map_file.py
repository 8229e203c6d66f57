"""A file of landmarks that somebody sent, read in a process of its own."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from itertools import islice
from pathlib import Path

from lidarcore.errors import MapFileError
from lidarcore.landmarks import Landmark, read_landmarks

from ..isolation import Isolated

MOST = 250_000  # landmarks, which take 100 MB; a house has some hundred
_TOGETHER = 1000  # landmarks that come over at a time


def landmarks_of(path: Path, format: str) -> list[Landmark]:
    """The landmarks of a file (one of FORMATS), without ids. Raises MapFileError, also if there are more than MOST."""
    with closing(Isolated(f"the {format}", MapFileError, _read, path, format)) as reading:
        found: list[Landmark] = []
        for together in reading:
            found += (replace(landmark, id=None) for landmark in together)
            if len(found) > MOST:
                raise MapFileError(f"This {format} holds more than {MOST} landmarks: load a part of it.")
    return found


def _read(path: Path, format: str) -> Iterator[list[Landmark]]:
    with path.open(encoding="utf-8-sig", newline="") as text:
        found = read_landmarks(text, format)
        while together := list(islice(found, _TOGETHER)):
            yield together
