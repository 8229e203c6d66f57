"""A thread that writes what is put in its queue, for callers who must not wait."""

import logging
import queue
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Generic, TypeVar

from lidarcore import LidarError, threads

IDLE = 0.25  # s without anything to write, after which `idle` is called
END_WITHIN = 10.0  # s that a slow disk may take for what waits

logger = logging.getLogger(__name__)
Item = TypeVar("Item")


class Spooler(Generic[Item]):
    """Calls `write` with each item in a thread of its own; those that find the queue full are dropped and counted.

    idle    called when nothing comes for a while
    close   called at the end, also after an error
    failed  told in a sentence what ended it before its time
    """

    def __init__(
        self,
        length: int,
        write: Callable[[Item], None],
        idle: Callable[[], None],
        close: Callable[[], None],
        failed: Callable[[str], None],
    ) -> None:
        self.dropped = 0
        self._write, self._idle, self._close, self._failed = write, idle, close, failed
        self._queue: queue.Queue[Item | None] = queue.Queue(length)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="spooler", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def put(self, item: Item) -> None:
        try:
            self._queue.put_nowait(item)
        except queue.Full:
            self.dropped += 1

    def is_alive(self) -> bool:
        """Whether something may still be written."""
        return self._thread.is_alive()

    def end(self) -> None:
        """Take nothing more: write what waits, then close."""
        self._ending.set()
        with suppress(queue.Full):
            self._queue.put_nowait(None)  # wakes the thread

    def join(self) -> bool:
        """Wait (bounded) for the end; whether everything is written and closed."""
        return threads.join(self._thread, END_WITHIN)

    def _run(self) -> None:
        try:
            try:
                self._work()
            finally:
                self._close()
        except LidarError as error:
            self._failed(str(error))
        except Exception as error:
            logger.exception("a spooler stopped")
            self._failed(f"{type(error).__name__}: {error}")

    def _work(self) -> None:
        while True:
            try:
                item = self._queue.get(timeout=IDLE)
            except queue.Empty:
                if self._ending.is_set():
                    return
                self._idle()
            else:
                if item is not None:
                    self._write(item)
                elif self._queue.empty():
                    return
