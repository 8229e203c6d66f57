"""Recordings become maps one after the other, each in a process of its own, as `lidarcore map` finishes them."""

import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import count
from pathlib import Path

from lidarcore import LidarError
from lidarcore.errors import LandmarkError
from lidarcore.landmarks import MAX_NAME, session_name

from ...errors import ConflictError, NotFoundError
from ...pipeline.settings import Settings
from .making import Making, MakingStatus
from .names import stem_of
from .store import LandmarkStore

NO_FILES = (
    "No such map of a recording has files here: make one first, or see in GET /map/making which have ended. Files of "
    "the last eight that were finished are kept."
)
NONE_MADE = "No such map of a recording is being made, or waits: GET /map/making tells which are."
MOST = 8  # that wait; that are finished and kept, with their files; that have come to nothing and are told of


class MapMaker:
    """Makes maps of recordings, and keeps them in a store. Every method may be called from any thread.

    revision   another number whenever one was asked for, has begun or ended: who shows them asks again
    listeners  called after each, in the thread that made the change; they must not wait
    """

    def __init__(self, store: LandmarkStore) -> None:
        self.revision = 0
        self.listeners: list[Callable[[], None]] = []
        self._store = store
        self._ids = count(1)
        self._waiting: list[Making] = []
        self._running: Making | None = None
        self._ended: list[Making] = []
        self._lock = threading.Lock()

    def status(self) -> tuple[MakingStatus | None, list[MakingStatus], list[MakingStatus]]:
        """Of the map that is made, or else was made last; of those that wait; of those that have ended."""
        with self._lock:
            waiting, ended = ([making.status() for making in some] for some in (self._waiting, self._ended))
            now = self._running.status() if self._running else ended[-1] if ended else None
        return now, waiting, ended

    def files(self, id: int | None) -> tuple[Path, str]:
        """A zip of all files of a map, of the last one if none is named, and its name. Raises NotFoundError."""
        with self._lock:
            finished = [one for one in self._ended if one.state == "finished" and id in (None, one.id)]
        if not finished:
            raise NotFoundError(NO_FILES)
        made = finished[-1]
        assert made.session is not None
        return made.files, f"{stem_of(self._store.atlas, made.session)}-with-poses.zip"

    def start(self, path: Path, topic: str | None, scans: int | None, settings: Settings) -> MakingStatus:
        """Make a map of the recording at a path, of so many scans, with the settings of the sensor and of walls.

        While another one is made it waits. Raises ConflictError if this one is made or waits already, or too many
        wait, StorageError.
        """
        with self._lock:
            self._check(path, topic)
            making = Making.of(next(self._ids), path, topic, scans, settings)
            self._waiting.append(making)
            self._go_on()
            self._changed()
            return making.status()

    def cancel(self, id: int | None = None) -> None:
        """End what is made, and its process, or take one out that waits. Raises NotFoundError if there is none."""
        with self._lock:
            running = self._running if self._running and id in (None, self._running.id) else None
            waiting = [making for making in self._waiting if making.id == id]
            if not (running or waiting):
                raise NotFoundError(NONE_MADE)
            for making in waiting:
                self._waiting.remove(making)
                making.cancel()
                self._keep(making)
            if running:
                running.state = "cancelled"  # it has ended once its process has
            self._changed()
        if running and running.process:
            running.process.kill()

    def close(self) -> None:
        """End what is made and what waits, and remove all files."""
        with self._lock:
            self._forget(self._waiting)
        with suppress(NotFoundError):
            self.cancel()
        self._forget(self._ended)

    def _check(self, path: Path, topic: str | None) -> None:
        busy = [self._running, *self._waiting]
        if any(one is not None and (one.path, one.topic) == (path, topic) for one in busy):
            raise ConflictError(f"A map of {path.name} is being made, or waits: cancel it first.")
        if len(self._waiting) >= MOST:
            raise ConflictError(f"{MOST} maps wait already: wait for the end of one, or cancel one.")

    def _go_on(self) -> None:
        """Begin the next one that can be begun, if none is made."""
        while self._running is None and self._waiting:
            making = self._waiting.pop(0)
            try:
                making.begin(partial(self._end, making))
                self._running = making
            except OSError as error:
                making.end(None, f"Its process cannot be started: {error.strerror}. Ask for it again.")
                self._keep(making)

    def _end(self, making: Making, code: int, message: str) -> None:
        """Keep the map whose process has ended well, and go on."""
        if not making.path.exists():
            message = f"{making.recording} was deleted or renamed before its map was made."
        session, error = self._kept(making) if code == 0 and making.state == "running" else (None, message)
        with self._lock:
            making.end(session, error)
            if session is not None and making.state != "finished":  # cancelled at the last moment
                self._store.atlas.delete(session)
            self._keep(making)
            self._running = None
            self._go_on()
            self._changed()

    def _changed(self) -> None:
        self.revision += 1
        for listener in self.listeners:
            listener()

    def _kept(self, making: Making) -> tuple[int | None, str | None]:
        """The session that a map has become, or why it has not."""
        try:
            packed, named = making.packed(), _name_of(making.recording)
            return self._store.load(packed, "zip", making.recording, mode="slam", name=named).id, None
        except LidarError as error:
            return None, str(error)

    def _keep(self, making: Making) -> None:
        """Tell of one that has ended; no file of a map goes for one that came to nothing."""
        self._ended.append(making)
        is_finished = making.state == "finished"
        alike = [one for one in self._ended if (one.state == "finished") == is_finished]
        for earlier in alike[:-MOST]:
            self._ended.remove(earlier)
            earlier.forget()

    @staticmethod
    def _forget(some: list[Making]) -> None:
        """Remove all of them, with their files."""
        while some:
            some.pop().forget()


def _name_of(recording: str) -> str:
    """What the map of a recording is called until somebody renames it: as that, if it can be shown."""
    with suppress(LandmarkError):
        return session_name(Path(recording).stem[:MAX_NAME])
    return ""
