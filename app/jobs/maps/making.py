"""One map of a recording, from when it is asked for until its files are no longer kept."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal
from zipfile import ZIP_DEFLATED, ZipFile

from ...errors import storing
from ...pipeline.settings import Settings
from ...records import record
from ..command_process import CommandProcess

State = Literal["waiting", "running", "finished", "failed", "cancelled"]


@dataclass(frozen=True, slots=True)
class MakingStatus:
    """`done` of `total` scans, null where nobody knows how many; once all are done the map is adjusted as a whole.

    `id` is of this making, `session` that of the map, once it is finished; `error` says why it failed.
    """

    id: int
    recording: str
    state: State
    elapsed_s: float
    done: int
    total: int | None
    session: int | None
    error: str | None


@dataclass(eq=False)
class Making:
    """A map of the recording at a path, made with the settings of when it was asked for."""

    id: int
    path: Path
    topic: str | None
    total: int | None
    folder: TemporaryDirectory[str]
    state: State = "waiting"
    session: int | None = None
    error: str | None = None
    process: CommandProcess | None = None
    _begun: float | None = field(default=None, init=False)
    _ended: float | None = field(default=None, init=False)

    @classmethod
    def of(cls, id: int, path: Path, topic: str | None, total: int | None, settings: Settings) -> "Making":
        """One that waits. Raises StorageError."""
        with storing("No folder for the map can be made"):
            making = cls(id, path, topic, total, TemporaryDirectory(prefix="lidarcore-map-"))
            making._settings.write_text(settings.model_dump_json(), "utf-8")
        return making

    @property
    def recording(self) -> str:
        """What is mapped."""
        return self.path.name

    @property
    def files(self) -> Path:
        """A zip of all files of the map, once it is finished."""
        return self._within("map.zip")

    def status(self) -> MakingStatus:
        """How far it is."""
        elapsed = (self._ended or time.monotonic()) - self._begun if self._begun else 0.0
        return record(
            MakingStatus,
            self,
            elapsed_s=round(elapsed, 1),
            done=self.process.done if self.process else 0,
        )

    def begin(self, ended: Callable[[int, str], None]) -> None:
        """Run it in a process, whose exit code and message are told."""
        self.state, self._begun = "running", time.monotonic()
        wanted = [f"--output={self._output}", f"--settings={self._settings}"]
        topic = [f"--topic={self.topic}"] if self.topic else []
        self.process = CommandProcess(["map", str(self.path.absolute()), *wanted, *topic], ended)

    def end(self, session: int | None, error: str | None) -> None:
        """It has become the map of a session, or has failed, unless it was cancelled."""
        self._ended = time.monotonic()
        if self.state == "running":
            self.session, self.error = session, error
            self.state = "failed" if session is None else "finished"
        if self.state != "finished":
            self.forget()

    def cancel(self) -> None:
        """End one that waits."""
        self.state = "cancelled"
        self.end(None, None)

    def packed(self) -> Path:
        """All files of the map in one, which takes their place. Raises StorageError."""
        path = self.files
        with storing("The map cannot be packed"), ZipFile(path, "w", ZIP_DEFLATED) as archive:
            for file in sorted(self._output.iterdir()):
                archive.write(file, file.name)
                file.unlink()
        return path

    def forget(self) -> None:
        """Remove its files."""
        self.folder.cleanup()

    @property
    def _settings(self) -> Path:
        return self._within("settings.json")

    @property
    def _output(self) -> Path:
        return self._within("map")

    def _within(self, name: str) -> Path:
        return Path(self.folder.name) / name
