"""Repeatability beside the live view: every new scan by all methods, while the sensor stands still."""

import logging
import threading
from dataclasses import replace
from typing import NamedTuple

from app.frame import Frame
from app.spooler import Spooler
from app.taken import Taken
from lidarcore import ExtractionSettings, compare
from lidarcore.evaluation.repeatability import Repeatability
from lidarcore.evaluation.repeatability_summary import Summary
from lidarcore.scan import Array

WAITING = 10  # scans; each takes about a millisecond

logger = logging.getLogger(__name__)


class _Kind(NamedTuple):
    """What the scans of a window have in common."""

    source: int
    window: int
    extraction: ExtractionSettings


class LiveRepeatability:
    """Is told of every frame, and works on its scan in a thread of its own, started when it is first wanted.

    Any thread may call any method, but only one may tell.
    """

    def __init__(self) -> None:
        self._spooler: Spooler[tuple[int, Frame]] | None = None
        self._running = False
        self._study = Repeatability()
        self._kind: _Kind | None = None
        self._last: Taken | None = None
        self._failing = False
        self._begun = 0  # times it began anew; scans told of before that are dropped
        self._lock = threading.Lock()

    def tell(self, frame: Frame) -> None:
        """Work on the scan of this frame if the settings want that. What was found stays until they want it again."""
        running, before = frame.settings.repeatability.running, self._running
        self._running = running
        if not running:
            return
        if not before:
            self.clear()
        if self._spooler is None:
            self._spooler = Spooler(WAITING, self._attempt, _nothing, _nothing, logger.error)
            self._spooler.start()
        self._spooler.put((self._begun, frame))

    def close(self) -> None:
        """End the thread."""
        if self._spooler is not None:
            self._spooler.end()

    def clear(self) -> None:
        """Begin anew, without the scans that still wait."""
        with self._lock:
            self._begun += 1
            self._study.clear()
            self._last = None

    def summary(self) -> Summary:
        """What the window says now."""
        with self._lock:
            return self._study.summary()

    def deviations(self, corner: int) -> dict[str, Array]:
        """(N, 2) m, by method, as Repeatability.deviations tells. Raises EvaluationError for an unknown corner."""
        with self._lock:
            return self._study.deviations(corner)

    def _attempt(self, told: tuple[int, Frame]) -> None:
        """One bad scan must not end it, nor may a thousand of them fill the log."""
        begun, frame = told
        try:
            self._add(begun, frame)
            self._failing = False
        except Exception:
            if not self._failing:
                logger.exception("scan %s could not be compared", frame.taken.position)
            self._failing = True

    def _add(self, begun: int, frame: Frame) -> None:
        kind = _kind(frame)
        with self._lock:
            if begun != self._begun:
                return
            if kind != self._kind:
                self._study, self._kind, self._last = Repeatability(kind.window), kind, None
            elif _leaps(self._last, frame.taken):
                self._study.clear()
            elif not _follows(self._last, frame.taken):
                return
            self._last = frame.taken
        features = compare(frame.taken.scan, kind.extraction)
        with self._lock:
            if begun == self._begun:
                self._study.add(features)


def _kind(frame: Frame) -> _Kind:
    """All methods and both covariances are told of, whichever are chosen."""
    chosen, default = frame.settings.extraction, ExtractionSettings()
    neutral = replace(chosen, fitter=default.fitter, covariance=default.covariance)
    return _Kind(frame.taken.source, frame.settings.repeatability.window, neutral)


def _follows(last: Taken | None, now: Taken) -> bool:
    """Not one that was counted: it is shown again after a change of settings, or looked back at in a live source."""
    return last is None or now.position["index"] > last.position["index"]


def _leaps(last: Taken | None, now: Taken) -> bool:
    """Whether a recording goes on elsewhere. Scans are left out where it plays faster than they can be shown."""
    if last is None or now.position["count"] is None:
        return False
    by = now.position["index"] - last.position["index"]
    return by < 0 or (by > 1 and now.seeks != last.seeks)


def _nothing() -> None: ...
