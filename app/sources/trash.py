"""Deleted recordings, which can be taken back for a while."""

import shutil
import tempfile
import threading
from dataclasses import dataclass, field
from pathlib import Path

from ..errors import NotFoundError

UNDO_WITHIN = 60.0
"""Seconds for which what was deleted can be taken back."""
PREFIX = ".trash-"
"""Begins the names of the folders in which it waits, beside where it was."""


@dataclass
class Trash:
    """Files and folders, each in a folder of its own until `undo_within` seconds have passed. For any thread."""

    undo_within: float = UNDO_WITHIN
    _timers: dict[Path, threading.Timer] = field(default_factory=dict)  # of what waits, the last deleted last
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def put(self, path: Path) -> None:
        """Take it away from where it is. Raises OSError."""
        with self._lock:
            bin_ = Path(tempfile.mkdtemp(dir=path.parent, prefix=PREFIX))
            path.rename(bin_ / path.name)
            timer = threading.Timer(self.undo_within, self._remove, [bin_ / path.name])
            timer.daemon = True
            self._timers[bin_ / path.name] = timer
            timer.start()

    def take_back(self, path: Path) -> None:
        """Put back what was taken away from there last. Raises NotFoundError if that is gone, and OSError."""
        with self._lock:
            kept = next((one for one in reversed(self._timers) if one.name == path.name), None)
            if kept is None:
                raise NotFoundError(
                    f"{path.name!r} cannot be restored: deleted files are kept for only {self.undo_within:g} s."
                )
            self._timers.pop(kept).cancel()
            kept.rename(path)
            kept.parent.rmdir()

    def empty(self) -> None:
        """Remove everything for good."""
        for kept in list(self._timers):
            self._remove(kept)

    def _remove(self, kept: Path) -> None:
        with self._lock:
            if timer := self._timers.pop(kept, None):
                timer.cancel()
                shutil.rmtree(kept.parent, ignore_errors=True)
