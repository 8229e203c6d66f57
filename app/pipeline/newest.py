"""The hand-over from the player to the worker: the newest scan wins."""

import threading

from ..sources.timed_scan import TimedScan


class NewestScan:
    """Holds the newest scan; one that is overwritten before it was taken is counted."""

    def __init__(self) -> None:
        self._item: TimedScan | None = None
        self._closed = self._busy = False
        self._condition = threading.Condition()
        self.dropped = 0

    @property
    def idle(self) -> bool:
        """Nothing waits and nothing is being worked on."""
        return self._item is None and not self._busy

    def put(self, item: TimedScan) -> None:
        with self._condition:
            self.dropped += self._item is not None and self._item.scan is not item.scan
            self._item = item
            self._condition.notify()

    def take(self) -> TimedScan | None:
        """Wait for a scan; None when closed."""
        with self._condition:
            self._condition.wait_for(lambda: self._item is not None or self._closed)
            item, self._item = self._item, None
            self._busy = True
            return None if self._closed else item

    def done(self) -> None:
        """The scan taken last has been dealt with."""
        self._busy = False

    def close(self) -> None:
        with self._condition:
            self._closed = True
            self._condition.notify()
