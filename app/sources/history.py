"""What live sources have in common: scans numbered as they come, the last ones kept, and others told of each."""

import threading
import time
from abc import abstractmethod
from collections import deque
from collections.abc import Callable

from lidarcore import Scan
from lidarcore.threads import FailureLog, join

from .source import END_WITHIN, HISTORY, Source


class HistorySource(Source):
    """Scans as they come, numbered from 0; the last HISTORY, and the one shown last, can be shown again.

    tell   is called with every scan after it arrived, by the thread that brings them
    """

    live = True

    def __init__(self, tell: Callable[[Scan], None]) -> None:
        self._tell = tell
        self._telling = FailureLog("a scan could not be passed on")
        self._thread = threading.Thread(target=self._follow, name="live", daemon=True)
        self._arrived: Callable[[], None] = lambda: None
        self._changed: Callable[[], None] = lambda: None
        self._lock = threading.Lock()
        self._kept: deque[tuple[Scan, float]] = deque(maxlen=HISTORY)
        self._shown: tuple[int | None, tuple[Scan, float] | None] = (None, None)
        self._first_stamp = 0.0
        self._count = 0

    @property
    def count(self) -> int:
        return self._count

    def nearest(self, index: int) -> int:
        if index == self._shown[0]:
            return index
        return max(self._count - len(self._kept), min(index, self._count - 1), 0)

    def scan(self, index: int) -> Scan | None:
        kept = self._at(index)
        if kept is None:
            return None
        self._shown = index, kept  # however long it is looked at
        return kept[0]

    def some(self) -> list[Scan]:
        with self._lock:
            return [scan for scan, _ in self._kept]

    def arrival(self, index: int) -> float:
        return kept[1] if (kept := self._at(index)) else time.monotonic()

    def time(self, index: int) -> float:
        return kept[0].stamp - self._first_stamp if (kept := self._at(index)) else 0.0

    def start(self, arrived: Callable[[], None], progress: Callable[[], None]) -> None:
        self._arrived, self._changed = arrived, progress
        self._thread.start()

    def close(self) -> None:
        join(self._thread, END_WITHIN)

    @abstractmethod
    def _follow(self) -> None:
        """Pass each scan to `_take` as it comes, until closed."""

    def _take(self, scan: Scan, arrival: float) -> None:
        """Keep a scan whose last byte came at `arrival` (time.monotonic, s), and tell of it."""
        with self._lock:
            if self._count == 0:
                self._first_stamp = scan.stamp
            self._kept.append((scan, arrival))
            self._count += 1
        self._arrived()
        with self._telling():  # what others make of a scan must not end the view
            self._tell(scan)

    def _at(self, index: int) -> tuple[Scan, float] | None:
        if index == self._shown[0]:
            return self._shown[1]
        with self._lock:
            place = index - (self._count - len(self._kept))
            return self._kept[place] if 0 <= place < len(self._kept) else None
