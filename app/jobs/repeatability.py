"""Repeatability beside the live view: every new scan by all methods, while the sensor stands still."""

import logging
import threading
from dataclasses import replace
from typing import NamedTuple

from lidarcore import Array, ExtractionSettings, compare
from lidarcore.body_mask import Sector
from lidarcore.evaluation.repeatability.statistics import Repeatability
from lidarcore.evaluation.repeatability.summary import Summary
from lidarcore.threads import FailureLog

from ..pipeline.frame import Frame
from ..sources.timed_scan import TimedScan
from .spooler import Spooler

WAITING = 10  # scans; each takes about a millisecond

logger = logging.getLogger(__name__)


class _Kind(NamedTuple):
    """What the scans of a window have in common."""

    source: int
    window: int
    extraction: ExtractionSettings
    mask: tuple[Sector, ...]


class LiveRepeatability:
    """Is told of every frame, and works on its scan in a thread of its own, started when it is first wanted.

    Any thread may call any method, but only one may tell.
    """

    def __init__(self) -> None:
        self._spooler: Spooler[tuple[int, Frame]] | None = None
        self._running = False
        self._study = Repeatability()
        self._kind: _Kind | None = None
        self._last: TimedScan | None = None
        self._adding = FailureLog("scan %s could not be compared")
        self._begun = 0  # times it started over; scans told of before that are dropped
        self._lock = threading.Lock()

    def observe(self, frame: Frame) -> None:
        """Work on the scan of this frame if the settings want that. What was found stays until they want it again."""
        running, before = frame.settings.repeatability.running, self._running
        self._running = running
        if not running:
            return
        if not before:
            self.clear()
        if self._spooler is None:
            self._spooler = Spooler(WAITING, self._work, _nothing, _nothing, logger.error)
            self._spooler.start()
        self._spooler.put((self._begun, frame))

    def close(self) -> None:
        """End the thread."""
        if self._spooler is not None:
            self._spooler.end()
            self._spooler.join()

    def clear(self) -> None:
        """Start over, without the scans that still wait."""
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

    def wall_deviations(self, wall: int) -> dict[str, Array]:
        """(N, 2) rad, m, by method, as Repeatability.wall_deviations tells. Raises EvaluationError if unknown."""
        with self._lock:
            return self._study.wall_deviations(wall)

    def _work(self, item: tuple[int, Frame]) -> None:
        begun, frame = item
        with self._adding(frame.timed.position):
            self._add(begun, frame)

    def _add(self, begun: int, frame: Frame) -> None:
        kind = _kind(frame)
        with self._lock:
            if begun != self._begun:
                return
            if kind != self._kind:
                self._study, self._kind, self._last = Repeatability(kind.window), kind, None
            elif _leaps(self._last, frame.timed):
                self._study.clear()
            elif not _follows(self._last, frame.timed):
                return
            self._last = frame.timed
        features = compare(frame.timed.scan, kind.extraction)
        with self._lock:
            if begun == self._begun:
                self._study.add(features)


def _kind(frame: Frame) -> _Kind:
    """What the window depends on: not on the chosen method and covariance, since all of them are told of."""
    chosen, default = frame.settings.extraction, ExtractionSettings()
    neutral = replace(chosen, fitter=default.fitter, covariance=default.covariance)
    return _Kind(
        frame.timed.source, frame.settings.repeatability.window, neutral, frame.settings.sensor.mask or ()
    )


def _follows(last: TimedScan | None, now: TimedScan) -> bool:
    """Not one that was counted: it is shown again after a change of settings, or looked back at in a live source."""
    return last is None or now.position.index > last.position.index


def _leaps(last: TimedScan | None, now: TimedScan) -> bool:
    """Whether a recording goes on elsewhere. Scans are left out where it plays faster than they can be shown."""
    if last is None or now.position.count is None:
        return False
    by = now.position.index - last.position.index
    return by < 0 or (by > 1 and now.seeks != last.seeks)


def _nothing() -> None: ...
