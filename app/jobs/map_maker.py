"""Recordings become maps one at a time, each in a process of its own, finished as `lidarcore map` finishes them."""

import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal
from zipfile import ZIP_DEFLATED, ZipFile

from lidarcore import LidarError
from lidarcore.landmarks import MAX_NAME

from ..errors import ConflictError, NotFoundError, storing
from ..pipeline.settings import Settings
from ..records import record
from .command_process import CommandProcess
from .landmark_store import LandmarkStore

State = Literal["running", "finished", "failed", "cancelled"]


@dataclass(frozen=True, slots=True)
class MakingStatus:
    """`done` of `total` scans, null where nobody knows how many; once all are done the map is adjusted as a whole.

    `session` is that of the map, once it is finished; `error` says why it failed.
    """

    recording: str
    state: State
    elapsed_s: float
    done: int
    total: int | None
    session: int | None
    error: str | None


@dataclass(eq=False)
class _Making:
    """One map, from its start until another one is started."""

    recording: str
    total: int | None
    folder: TemporaryDirectory[str]
    state: State = "running"
    session: int | None = None
    error: str | None = None
    started: float = field(default_factory=time.monotonic)
    ended: float | None = None
    process: CommandProcess | None = None

    def status(self) -> MakingStatus:
        elapsed = (self.ended or time.monotonic()) - self.started
        done = self.process.done if self.process else 0
        return record(MakingStatus, self, elapsed_s=round(elapsed, 1), done=done)


class MapMaker:
    """Makes maps of recordings, and keeps them in a store. Every method may be called from any thread."""

    def __init__(self, store: LandmarkStore) -> None:
        self._store = store
        self._made: _Making | None = None
        self._lock = threading.Lock()

    @property
    def status(self) -> MakingStatus | None:
        """Of the map that is made, or was made last; None at first."""
        return self._made.status() if self._made else None

    @property
    def files(self) -> Path:
        """A zip of all files of the map that was made last. Raises NotFoundError if there is none."""
        if self._made is None or self._made.state != "finished":
            raise NotFoundError("No map of a recording is finished: make one first.")
        return _files(self._made, self._made.session)

    def start(self, path: Path, topic: str | None, scans: int | None, settings: Settings) -> MakingStatus:
        """Make a map of the recording at a path, of so many scans, with the settings of the sensor and of walls.

        Raises ConflictError if one is made already, StorageError.
        """
        with self._lock:
            if self._made and self._made.state == "running":
                raise ConflictError(
                    f"A map of {self._made.recording} is being made: wait for its end, or cancel it first."
                )
            self._forget()
            with storing("No folder for the map can be made"):
                folder = TemporaryDirectory(prefix="lidarcore-map-")
                chosen = Path(folder.name) / "settings.json"
                chosen.write_text(settings.model_dump_json(), "utf-8")
            made = _Making(path.name, scans, folder)
            wanted = [
                f"--output={_output(made)}",
                f"--settings={chosen}",
                *([f"--topic={topic}"] if topic else []),
            ]
            made.process = CommandProcess(
                ["map", str(path.absolute()), *wanted], lambda code, message: self._end(made, code, message)
            )
            self._made = made
            return made.status()

    def cancel(self) -> None:
        """End what is made, and its process. Raises NotFoundError if nothing is."""
        with self._lock:
            made = self._made
            if made is None or made.state != "running":
                raise NotFoundError("No map of a recording is being made.")
            made.state = "cancelled"
        if made.process:
            made.process.kill()

    def close(self) -> None:
        """End what is made, and remove its files."""
        with suppress(NotFoundError):
            self.cancel()
        self._forget()

    def _forget(self) -> None:
        if self._made:
            self._made.folder.cleanup()

    def _end(self, made: _Making, code: int, message: str) -> None:
        """Keep the map whose process has ended well."""
        session, error = self._kept(made) if code == 0 and made.state == "running" else (None, message)
        with self._lock:
            made.ended = time.monotonic()
            if made.state == "running":
                made.session, made.error = session, error
                made.state = "failed" if session is None else "finished"
            elif session is not None:  # cancelled at the last moment
                self._store.atlas.delete(session)
            if made.state != "finished":
                made.folder.cleanup()

    def _kept(self, made: _Making) -> tuple[int | None, str | None]:
        """The session that a map has become, or why it has not."""
        try:
            packed = _packed(made)
            named = _name_of(made.recording)
            session = self._store.load(packed, "zip", made.recording, mode="slam", name=named).id
            with storing("The files cannot be named"):
                packed.rename(_files(made, session))
            return session, None
        except LidarError as error:
            return None, str(error)


def _name_of(recording: str) -> str:
    """What the map of a recording is called until somebody renames it."""
    name = Path(recording).stem[:MAX_NAME]
    return name if name.isprintable() else ""


def _output(made: _Making) -> Path:
    return Path(made.folder.name) / "map"


def _files(made: _Making, session: int | None) -> Path:
    return Path(made.folder.name) / f"map-{session}.zip"


def _packed(made: _Making) -> Path:
    """All files of a map in one. Raises StorageError."""
    path = _files(made, None)
    with storing("The map cannot be packed"), ZipFile(path, "w", ZIP_DEFLATED) as archive:
        for file in sorted(_output(made).iterdir()):
            archive.write(file, file.name)
    return path
