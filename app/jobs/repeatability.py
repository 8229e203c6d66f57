"""Repeatability beside the live view: every new scan by all methods, while the sensor stands still."""

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


class _Kind(NamedTuple):
    """What the scans of a window have in common."""

    source: int
    window: int
    extraction: ExtractionSettings
    mask: tuple[Sector, ...]


class LiveRepeatability:
    """Is told of every frame by one thread, which takes half a millisecond; any may ask."""

    def __init__(self) -> None:
        self._running = False
        self._study = Repeatability()
        self._kind: _Kind | None = None
        self._last: TimedScan | None = None
        self._adding = FailureLog("scan %s could not be compared")
        self._lock = threading.Lock()

    def observe(self, frame: Frame) -> None:
        """Take the scan of this frame if the settings want that. What was found stays until they want it again."""
        running, before = frame.settings.repeatability.running, self._running
        self._running = running
        if running and not before:
            self.clear()
        if running:
            with self._adding(frame.timed.position), self._lock:
                self._add(frame)

    def clear(self) -> None:
        """Start over."""
        with self._lock:
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

    def _add(self, frame: Frame) -> None:
        kind = _kind(frame)
        if kind != self._kind:
            self._study, self._kind = Repeatability(kind.window), kind
        elif _leaps(self._last, frame.timed):
            self._study.clear()
        elif not _follows(self._last, frame.timed):
            return
        self._last = frame.timed
        self._study.add(compare(frame.timed.scan, kind.extraction))


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
