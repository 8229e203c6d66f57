"""The thread that writes maps to the disk: of each run the newest, in its turn, again and again until that works."""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace

from lidarcore.errors import LidarError, UnknownLandmarkError, UnknownSessionError
from lidarcore.threads import join

from ..spooler import END_WITHIN
from .session_writer import MapChange, SessionWriter, Waiting

PAUSE = 0.25  # s between two transactions: how far the disk may be behind
RETRY = 1.0  # s after one that failed
MOST_RUNS = 8  # that have something waiting to be written

logger = logging.getLogger(__name__)


class WriteQueue:
    """What waits to be written, and the thread that does so.

    error  why the newest map is not on the disk, in a sentence; None as long as it works
    """

    def __init__(self, written: Callable[[MapChange], None], ended: Callable[[SessionWriter], None]) -> None:
        """`written` is called in the thread with what was written, `ended` with a run of which all was."""
        self._written, self._ended = written, ended
        self.error: str | None = None
        self._waiting: dict[SessionWriter, Waiting] = {}
        self._writing: Waiting | None = None
        self._news = threading.Condition()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._work, name="landmarks", daemon=True)
        self._thread.start()

    def close(self) -> bool:
        """Wait (bounded) until all is written; False if the thread may still write."""
        self._closing.set()
        with self._news:
            self._news.notify_all()
        return join(self._thread, END_WITHIN)

    def settle(self, within: float) -> bool:
        """Wait until all is written, at most so many seconds; whether it is."""
        with self._news:
            return self._news.wait_for(lambda: not self._waiting and self._writing is None, within)

    @property
    def behind_s(self) -> float:
        """For how long something has waited, s."""
        with self._news:
            waiting = [*self._waiting.values(), *([self._writing] if self._writing else [])]
        return max((time.monotonic() - one.since for one in waiting), default=0.0)

    def schedule(self, run: SessionWriter, newest: Waiting) -> None:
        """Have the newest map of a run written in its turn; that the run has ended is not forgotten."""
        with self._news:
            before = self._waiting.pop(run, newest)
            self._waiting[run] = replace(newest, since=before.since, ended=newest.ended or before.ended)
            while len(self._waiting) > MOST_RUNS:
                del self._waiting[next(iter(self._waiting))]
                self.error = f"More than {MOST_RUNS} maps waited to be written: the oldest is lost."
                logger.warning(self.error)
            self._news.notify_all()

    def _work(self) -> None:
        while (pause := self._write_next()) is not None:
            self._closing.wait(pause)

    def _write_next(self) -> float | None:
        """Wait for something and write it; how long to wait before the next, s, or None if there is to be none.

        What was written is let go of here: while nothing comes, maps of hundreds of megabytes would stay.
        """
        with self._news:
            self._news.wait_for(lambda: self._waiting or self._closing.is_set())
            if not self._waiting:
                return None
            run = next(iter(self._waiting))
            self._writing = waiting = self._waiting.pop(run)
        is_last = self._closing.is_set()
        pause = self._attempt(run, waiting)
        with self._news:
            self._writing = None
            self._news.notify_all()
        return None if is_last and self.error else pause

    def _attempt(self, run: SessionWriter, waiting: Waiting) -> float:
        """Write, and tell; how long to wait before the next time, s."""
        try:
            change = run.write(*waiting.content, final=waiting.ended)
            if waiting.ended:
                run.finish()
                self._ended(run)
            self.error = None
            if change:
                self._written(change)
        except Exception as error:
            return self._put_back(run, waiting, error)
        return PAUSE if change else 0.0

    def _put_back(self, run: SessionWriter, waiting: Waiting, error: Exception) -> float:
        """A run waits on if nothing newer does; but a deleted map does not come back when its run has ended."""
        is_deleted = isinstance(error, UnknownLandmarkError | UnknownSessionError)
        if not (is_deleted and waiting.ended):
            with self._news:
                self._waiting[run] = replace(self._waiting.get(run, waiting), since=waiting.since)
        if is_deleted:
            self.error = None
            return PAUSE
        if isinstance(error, LidarError):
            self.error = str(error)
        else:
            logger.error("the map could not be written", exc_info=error)
            self.error = "The map is not written: the log of the server says why."
        return RETRY
