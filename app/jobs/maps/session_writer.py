"""A run of SLAM as it goes into the file of maps: it gives what it has, and never waits for the disk."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from lidarcore.landmarks import Atlas, Landmark, LandmarkMap


@dataclass(frozen=True, slots=True)
class MapChange:
    """What was written: landmarks as they are on the disk now, with their ids there, and ids that were taken out."""

    session: int
    landmarks: tuple[Landmark, ...]
    removed: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Waiting:
    """The newest map of a run, as its `write` takes it, for the last time or not; something has waited since then."""

    content: tuple[Any, ...]
    ended: bool
    since: float


class SessionWriter(ABC):
    """Writes one run into a session of its own, which begins with the first thing that is worth it.

    `put` and `end` return at once; what they schedule is `write` and `finish`, in the thread of the queue.

    replay  equal for runs that lead to the same map, as when a recording is repeated; else None
    ids     in the file of the landmarks on the disk, by those of the navigator
    """

    ids: Mapping[int, int] = MappingProxyType({})

    def __init__(
        self,
        atlas: Atlas,
        source: str,
        schedule: Callable[["SessionWriter", Waiting], None],
        replay: Hashable,
    ) -> None:
        self.replay = replay
        self._atlas, self._source, self._schedule, self._started = atlas, source, schedule, time.time()
        self._map: LandmarkMap | None = None
        self._newest: tuple[Any, ...] | None = None
        self._has_ended = False

    @property
    def session(self) -> int | None:
        """The session in the file; None until something of the map is on the disk."""
        return None if self._map is None else self._map.session

    def put(self, *content: Any) -> None:
        """Write the map as it is now, unless a newer one comes first; the arguments are those of `write`.

        The last one may come when the run has ended.
        """
        self._newest = content
        self._schedule(self, Waiting(content, self._has_ended, since=time.monotonic()))

    def end(self) -> None:
        """Write what is left, and that the run has ended."""
        self._has_ended = True
        if self._newest is not None:
            self._schedule(self, Waiting(self._newest, ended=True, since=time.monotonic()))

    @abstractmethod
    def write(self, *content: Any, **options: Any) -> MapChange | None:
        """Bring the disk up to date with the map; with `final=True`, in everything. Raises LandmarkMapError."""

    def finish(self) -> None:
        """Note in the file that the run has ended. Raises LandmarkMapError."""
        if self._map is not None:
            self._atlas.end(self._map.session, time.time())

    def _begun(self) -> LandmarkMap:
        """The map of the session, which begins now unless it has."""
        if self._map is None:
            self._map = self._atlas.begin(self._source, self._started, "slam")
        return self._map
