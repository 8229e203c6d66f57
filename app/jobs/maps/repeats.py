"""Maps of what is replayed, a recording from its beginning again: of those that lead to the same, one is kept."""

from collections.abc import Callable, Hashable
from contextlib import suppress
from typing import NamedTuple

from lidarcore.errors import UnknownSessionError
from lidarcore.landmarks import Atlas, LandmarkMap

from .session_writer import SessionWriter

SLACK = 0.1  # of what a map saw, by which another one of the same may have seen less


class Span(NamedTuple):
    """From when to when a map saw something, s, by the clock of what it is of."""

    first: float
    last: float

    def covers(self, other: "Span") -> bool:
        """Whether it holds the other one, but for a little at the ends."""
        little = SLACK * (other.last - other.first)
        return self.first <= other.first + little and self.last >= other.last - little


class Repeats:
    """Knows which maps of what is replayed are finished, and gives up those that another one makes needless."""

    def __init__(self, atlas: Atlas, is_used: Callable[[int], bool]) -> None:
        """`is_used` tells whether the map of a session is in use."""
        self._atlas, self._is_used = atlas, is_used
        # By what is replayed, the sessions of its finished maps, and from when to when they saw something.
        self._finished: dict[Hashable, dict[int, Span]] = {}

    def replace_earlier(self, run: SessionWriter) -> None:
        """Give up the maps of earlier runs with the same `replay` that saw no more of it than this one, now ended.

        Those that are in use are kept, and those that somebody has named.
        """
        if run.replay is None or run.session is None:
            return
        try:
            seen = _span(self._atlas[run.session])
        except UnknownSessionError:  # somebody else gave it up
            return
        finished = self._finished.setdefault(run.replay, {})
        covered = [session for session, span in finished.items() if seen.covers(span)]
        finished[run.session] = seen
        for earlier in covered:
            if earlier < run.session and not self._is_used(earlier):
                del finished[earlier]
                with suppress(UnknownSessionError):
                    if not self._atlas.session(earlier).name:
                        self._atlas.delete(earlier)


def _span(map: LandmarkMap) -> Span:
    seen = [(mark.first_seen, mark.last_seen) for mark in [*map, *map.walls()]]
    return Span(min((first for first, _ in seen), default=0.0), max((last for _, last in seen), default=0.0))
