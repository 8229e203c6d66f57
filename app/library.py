"""The folder of recordings: what is in it, and how something gets in and out. Nothing is written outside."""

import re
import shutil
import tempfile
from collections.abc import AsyncIterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import anyio
from typing_extensions import TypedDict

from app.problems import ProblemError
from app.sources import check_readable

MAX_BYTES = 1 << 30
BUILTIN = tuple(sorted((Path(__file__).parent / "demo").glob("*.mcap")))
BAG_FILES = (".db3", ".mcap")  # what makes a folder a ROS 2 bag
# A file name on every system.
PLAIN_NAME = re.compile(r"(?!\.)[^/\\:*?\"<>|\x00-\x1f\x7f\ud800-\udfff]{1,200}(?<![. ])")


class RecordingJson(TypedDict):
    name: str
    size: int
    modified: str
    builtin: bool


@dataclass(frozen=True)
class Library:
    """Recordings in one folder, the one given on the command line, wherever that is, and those that come along."""

    folder: Path
    max_bytes: int = MAX_BYTES
    given: Path | None = None
    builtin: tuple[Path, ...] = BUILTIN

    def list(self) -> list[RecordingJson]:
        """What could be played: files, and folders that are ROS 2 bags."""
        paths = set(self.folder.iterdir()) if self.folder.is_dir() else set()
        elsewhere = [path for path in self._elsewhere if not (self.folder / path.name).exists()]
        candidates = filter(_is_candidate, {*paths, *elsewhere})
        return [self._entry(path) for path in sorted(candidates, key=lambda p: p.name.lower())]

    def path(self, name: str) -> Path:
        """Where the recording is. Raises ProblemError 404 if there is none, 422 if that is no file name."""
        if self.given is not None and self._is_given(name):
            return self.given
        path = self.folder / checked_name(name)
        if not path.exists():
            path = next((path for path in self.builtin if path.name == name), path)
        if not _is_candidate(path):
            raise ProblemError(404, f"There is no recording {name!r}.")
        return path

    def delete(self, name: str) -> None:
        """Delete it. Raises ProblemError like `path`, and 409 for one that is not in the folder."""
        path = self.path(name)
        if path.parent != self.folder:
            whence = "it comes with lidarcore" if path in self.builtin else "it was given on the command line"
            raise ProblemError(409, f"{name!r} is not in the recordings folder: {whence}.")
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()

    async def add(self, name: str, chunks: AsyncIterator[bytes], *, overwrite: bool) -> RecordingJson:
        """Store an upload under the name once all of it is there and a reader takes it.

        Raises ProblemError 409 if the name is taken, 413 if it is too large, 422 if it is no plain file name,
        and RecordingError if no reader takes it; nothing stays on disk then.
        """
        path = self.folder / checked_name(name)
        self._check_free(path, overwrite)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=self.folder, prefix=".upload-") as workplace:
                partial = Path(workplace) / path.name
                await self._write(partial, chunks)
                await anyio.to_thread.run_sync(check_readable, partial)
                self._check_free(path, overwrite)
                partial.replace(path)
        except OSError as error:
            raise ProblemError(507, f"The recording could not be stored: {error.strerror}.") from error
        return self._entry(path)

    def new(self, name: str) -> Path:
        """Where a new recording goes. Raises ProblemError 409 if the name is taken, 422 if it is no file name."""
        path = self.folder / checked_name(name)
        self._check_free(path, overwrite=False)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ProblemError(
                507, f"There can be no recordings folder {self.folder}: {error.strerror}."
            ) from error
        return path

    @property
    def _elsewhere(self) -> tuple[Path, ...]:
        return self.builtin if self.given is None else (self.given, *self.builtin)

    def _entry(self, path: Path) -> RecordingJson:
        status = path.stat()
        size = sum(file.stat().st_size for file in path.iterdir()) if path.is_dir() else status.st_size
        return {
            "name": path.name,
            "size": size,
            "modified": datetime.fromtimestamp(status.st_mtime, UTC).isoformat(timespec="seconds"),
            "builtin": path in self.builtin,
        }

    def _check_free(self, path: Path, overwrite: bool) -> None:
        if path.is_dir() or self._is_given(path.name) or (path.exists() and not overwrite):
            raise ProblemError(
                409, f"There is a recording {path.name!r} already: delete it or choose another name."
            )

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
        """Raise ProblemError 413 if an upload of so many bytes is too large."""
        if size > self.max_bytes:
            raise ProblemError(413, f"The recording is larger than the {self.max_bytes} bytes allowed.")


def checked_name(name: str) -> str:
    """The name, if it is a plain file name. Raises ProblemError 422 otherwise."""
    if not PLAIN_NAME.fullmatch(name) or len(name.encode()) > 200:
        raise ProblemError(
            422, f"{name!r} is not a plain file name: no slashes, no leading dot, at most 200 bytes."
        )
    return name


def _is_candidate(path: Path) -> bool:
    if path.name.startswith("."):
        return False
    return path.is_file() or any(file.suffix in BAG_FILES for file in path.glob("*"))
