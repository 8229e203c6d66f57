"""A new file that grows by whole pieces, so that a reader finds all of a piece or (after a crash) its beginning."""

import errno
from contextlib import suppress
from pathlib import Path

from lidarcore.errors import RecordingError

_CURES = {
    errno.ENOSPC: "the disk is full: free some space, or record to another disk",
    errno.EDQUOT: "the disk quota is used up: free some space, or record to another disk",
    errno.EFBIG: "the file may not grow any further (file system or ulimit -f): record in shorter pieces",
}


class GrowingFile:
    """Collects what is written, and appends it to the file in one go with every `flush`.

    tail  what a file of this kind ends with: written behind every piece, and overwritten by the next one
    Raises RecordingError (from any method) that names cause and cure; the file is then cut back to whole pieces
    and closed. A file that exists already is never touched.
    """

    def __init__(self, path: Path, tail: bytes = b"") -> None:
        self.path, self._end, self._tail = path, 0, tail
        self._pending = bytearray()
        try:
            self._file = path.open("xb", buffering=0)
        except FileExistsError:
            raise RecordingError(f"{path} exists already: give the recording another name.") from None
        except (OSError, ValueError) as error:  # ValueError: a zero byte in the path
            reason = error.strerror if isinstance(error, OSError) else error
            raise RecordingError(f"{path} cannot be created: {reason}.") from error

    @property
    def size(self) -> int:
        """Bytes that are in the file."""
        return self._end + len(self._tail) if self._end else 0

    @property
    def closed(self) -> bool:
        """Whether nothing more can be written: closed, or failed."""
        return self._file.closed

    def check_open(self) -> None:
        """Raise RecordingError if nothing more can be written."""
        if self.closed:
            raise RecordingError(f"{self.path} is closed: nothing more can be recorded into it.")

    def write(self, data: bytes) -> int:
        """Take up bytes of the next piece."""
        self.check_open()
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """Position in the file where the next bytes will be."""
        return self._end + len(self._pending)

    def flush(self) -> None:
        """Append what was taken up: after this, it survives the end of this process, however it comes."""
        piece = bytes(self._pending)
        self._pending.clear()
        try:
            self._write(piece + self._tail)
        except OSError as error:
            raise self._failed(error) from error
        self._end += len(piece)

    def complete(self) -> None:
        """Append what was taken up, which has an end of its own, and close the file."""
        self._tail = b""
        self.flush()
        self._file.truncate(self._end)
        self.close()

    def close(self) -> None:
        """Drop what was not flushed; an empty file is removed again."""
        if not self.closed:
            self._file.close()
            if not self._end:
                self.path.unlink(missing_ok=True)

    def _write(self, data: bytes) -> None:
        """Write behind the last piece, where its tail is."""
        self._file.seek(self._end)
        written = 0
        while written < len(data):
            written += self._file.write(data[written:]) or 0

    def _failed(self, error: OSError) -> RecordingError:
        with suppress(OSError):
            self._file.truncate(self._end)
            if self._end:
                self._write(self._tail)  # there was room for it before
        self.close()
        cure = _CURES.get(error.errno or 0, f"{error.strerror}: record to another disk")
        kept = f"The {self.size / 1e6:.1f} MB before can be read." if self.size else "Nothing was kept."
        return RecordingError(f"{self.path} cannot be written, {cure}. {kept}")
