"""The folder of recordings: what is in it, and how something gets in and out. Nothing is written outside."""

import shutil
import tempfile
import time
from collections.abc import AsyncIterator, Callable, Collection
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import anyio

from ..errors import ConflictError, NotFoundError, TooLargeError, storing
from .plain_names import checked_name, is_plain
from .recorded import check_readable
from .recording_facts import RecordingFacts, facts
from .trash import PREFIX as TRASHED
from .trash import Trash

MAX_BYTES = 1 << 30
_DEMO = Path(__file__).parents[1] / "demo"
BUILTIN = (_DEMO / "emulated-s1.mcap", _DEMO / "real-rplidar-windsor.npz")
UPLOADING = ".upload-"  # begins the names of folders in which uploads arrive
ABANDONED = 3600.0  # s without a change after which such a folder belongs to a server that was killed
BAG_FILES = (".db3", ".mcap")  # what makes a folder a ROS 2 bag


@dataclass(frozen=True, slots=True)
class RecordingEntry:
    """A recording that could be played: bytes, when it was written last, whether it comes along."""

    name: str
    size: int
    modified: str
    builtin: bool


@dataclass(frozen=True)
class Library:
    """Recordings in one folder, the one given on the command line, wherever that is, and those that come along.

    `in_use` tells the files that are being written: they are neither deleted nor replaced.
    """

    folder: Path
    max_bytes: int = MAX_BYTES
    given: Path | None = None
    builtin: tuple[Path, ...] = BUILTIN
    in_use: Callable[[], Collection[Path]] = tuple
    trash: Trash = field(default_factory=Trash)

    def list(self) -> list[RecordingEntry]:
        """What could be played: files, and folders that are ROS 2 bags."""
        paths = set(self.folder.iterdir()) if self.folder.is_dir() else set()
        elsewhere = [path for path in self._elsewhere if not (self.folder / path.name).exists()]
        entries = []
        for path in sorted({*paths, *elsewhere}, key=lambda path: path.name.lower()):
            with suppress(OSError):  # deleted meanwhile, or not to be read: it could not be played either
                if _is_candidate(path):
                    entries.append(self._entry(path))
        return entries

    def unlisted(self) -> tuple[str, ...]:
        """Names of what could be played but for its name, as they can be shown; what is hidden is meant to be."""
        paths = sorted(self.folder.iterdir()) if self.folder.is_dir() else []
        return tuple(
            path.name.encode(errors="backslashreplace").decode() for path in paths if _is_misnamed(path)
        )

    def path(self, name: str) -> Path:
        """Where the recording is. Raises NotFoundError if there is none, InvalidNameError if that is no file name."""
        if self.given is not None and self._is_given(name):
            return self.given
        path = self.folder / checked_name(name)
        if not path.exists():
            path = next((path for path in self.builtin if path.name == name), path)
        if not _is_candidate(path):
            raise NotFoundError(f"There is no recording {name!r}.")
        return path

    def delete(self, name: str) -> None:
        """Put it into the trash. Raises what `path` raises, StorageError, and ConflictError if it is not in here."""
        path = self._own(name)
        with storing("The recording could not be deleted"):
            self.trash.put(path)

    def restore(self, name: str) -> RecordingEntry:
        """Take back what was deleted. Raises NotFoundError if it is too late, ConflictError if the name is taken."""
        path = self.folder / checked_name(name)
        self._check_free(path, overwrite=False)
        with storing("The recording could not be restored"):
            self.trash.take_back(path)
        return self._entry(path)

    def rename(self, name: str, new: str) -> RecordingEntry:
        """Give it another name. Raises what `delete` raises, and ConflictError if the new name is taken."""
        path, to = self._own(name), self.folder / checked_name(new)
        self._check_free(to, overwrite=False)
        with storing("The recording could not be renamed"):
            path.rename(to)
        return self._entry(to)

    def facts(self, name: str) -> RecordingFacts:
        """What it holds: all of it is read for that, once. Raises what `path` raises."""
        return facts(self.path(name))

    def file(self, name: str) -> Path:
        """The recording as one file. Raises what `path` raises, and ConflictError for a folder."""
        path = self.path(name)
        if path.is_dir():
            raise ConflictError(f"{name!r} is a folder, not a file: copy it from {path.parent}.")
        return path

    def _own(self, name: str) -> Path:
        """Where one is that may be moved."""
        path = self.path(name)
        if path.parent != self.folder:
            whence = "it comes with lidarcore" if path in self.builtin else "it was given on the command line"
            raise ConflictError(f"{name!r} is not in the recordings folder: {whence}.")
        self._check_unused(path)
        return path

    async def add(self, name: str, chunks: AsyncIterator[bytes], *, overwrite: bool) -> RecordingEntry:
        """Store an upload under the name once all of it is there and a reader takes it.

        Raises ConflictError if the name is taken, TooLargeError, InvalidNameError, StorageError if
        the disk refuses, and RecordingError if no reader takes it; nothing stays on disk then.
        """
        path = self.folder / checked_name(name)
        self._check_free(path, overwrite)
        with storing("The recording could not be stored"):
            self.folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=self.folder, prefix=UPLOADING) as workplace:
                partial = Path(workplace) / path.name
                await self._write(partial, chunks)
                await anyio.to_thread.run_sync(check_readable, partial)
                self._check_free(path, overwrite)
                partial.replace(path)
        return self._entry(path)

    def new(self, name: str) -> Path:
        """Where a new recording goes. Raises ConflictError, InvalidNameError, StorageError."""
        path = self.folder / checked_name(name)
        self._check_free(path, overwrite=False)
        with storing(f"The recordings folder {self.folder} cannot be created"):
            self.folder.mkdir(parents=True, exist_ok=True)
        return path

    def remove_abandoned(self) -> None:
        """Remove what uploads and the trash left behind in a server that was killed."""
        for folder in (*self.folder.glob(f"{UPLOADING}*"), *self.folder.glob(f"{TRASHED}*")):
            with suppress(OSError):
                if (
                    time.time() - max(path.stat().st_mtime for path in (folder, *folder.iterdir()))
                    > ABANDONED
                ):
                    shutil.rmtree(folder)

    @property
    def _elsewhere(self) -> tuple[Path, ...]:
        return self.builtin if self.given is None else (self.given, *self.builtin)

    def _entry(self, path: Path) -> RecordingEntry:
        status = path.stat()
        size = sum(file.lstat().st_size for file in path.iterdir()) if path.is_dir() else status.st_size
        modified = datetime.fromtimestamp(status.st_mtime, UTC).isoformat(timespec="seconds")
        return RecordingEntry(path.name, size, modified, path in self.builtin)

    def _check_free(self, path: Path, overwrite: bool) -> None:
        if path.is_dir() or self._is_given(path.name) or (path.exists() and not overwrite):
            raise ConflictError(
                f"A recording named {path.name!r} already exists: delete it or choose another name."
            )
        self._check_unused(path)

    def _check_unused(self, path: Path) -> None:
        if path.resolve() in {used.resolve() for used in self.in_use()}:
            raise ConflictError(f"{path.name!r} is being written: stop that first.")

    def _is_given(self, name: str) -> bool:
        return self.given is not None and self.given.name == name

    async def _write(self, path: Path, chunks: AsyncIterator[bytes]) -> None:
        size = 0
        async with await anyio.open_file(path, "xb") as file:
            async for chunk in chunks:
                size += len(chunk)
                self.check_size(size)
                await file.write(chunk)

    def check_size(self, size: int) -> None:
        """Raise TooLargeError if an upload of so many bytes is too large."""
        if size > self.max_bytes:
            raise TooLargeError(f"The recording is larger than the {self.max_bytes} bytes allowed.")


def _is_candidate(path: Path) -> bool:
    """True for files and bags whose names can be asked for. Raises OSError if it cannot be looked at."""
    return is_plain(path.name) and _is_file_or_bag(path)


def _is_misnamed(path: Path) -> bool:
    with suppress(OSError):
        return not (path.name.startswith(".") or is_plain(path.name)) and _is_file_or_bag(path)
    return False


def _is_file_or_bag(path: Path) -> bool:
    return path.is_file() or any(file.suffix in BAG_FILES for file in path.glob("*"))
