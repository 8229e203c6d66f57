"""A thread that works off what is put in its queue: whoever brings scans never waits for loops, grid or walls."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

from lidarcore.threads import join

Item = TypeVar("Item")


class Worker(Generic[Item]):
    """Calls job(item, waiting) for each item in turn, `waiting` being the number of those behind it.

    Nothing is dropped: items are keyframes, each of which the map, or the path in a known map, keeps. What waits is
    thus never more than will be kept.

    idle  s without an item after which job(None, 0) is called; never if None
    last  called in the thread before it ends, unless something has ended it
    """

    def __init__(
        self,
        job: Callable[[Item | None, int], None],
        name: str,
        idle: float | None = None,
        last: Callable[[], None] = lambda: None,
    ) -> None:
        self._idle = idle
        self._queue: deque[Item] = deque()
        self._filled = threading.Condition()
        self._closing = False
        self._failure: BaseException | None = None
        # The job may hold the worker: only the thread holds the job, so that both are freed as soon as it has ended.
        self._thread = threading.Thread(target=self._run, args=(job, last), name=name, daemon=True)
        self._thread.start()

    @property
    def is_behind(self) -> bool:
        """Whether items wait."""
        return bool(self._queue)

    def put(self, item: Item) -> None:
        """Hand over an item, at once. Raises what ended the thread, if anything did."""
        self._check()
        with self._filled:
            self._queue.append(item)
            self._filled.notify_all()

    def end(self) -> None:
        """End after the item at hand; returns at once."""
        with self._filled:
            self._closing = True
            self._filled.notify_all()

    def close(self, within: float = threading.TIMEOUT_MAX) -> bool:
        """End after the item at hand, and wait for it, at most so many seconds; whether it has ended."""
        self.end()
        return join(self._thread, within)

    def _check(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _run(self, job: Callable[[Item | None, int], None], last: Callable[[], None]) -> None:
        try:
            while self._next(job):
                pass
            last()
        except BaseException as failure:  # told to whoever brings the next item
            self._failure = failure

    def _next(self, job: Callable[[Item | None, int], None]) -> bool:
        with self._filled:
            self._filled.wait_for(lambda: self._queue or self._closing, self._idle)
            if self._closing:
                return False
            item = self._queue.popleft() if self._queue else None
            waiting = len(self._queue)
        job(item, waiting)
        return True
