"""Recordings as a source, read ahead in the background."""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from lidarcore import LidarError, RecordingError, Scan, TopicError, open_recording
from lidarcore.body_mask import Sector
from lidarcore.threads import join

from ..isolation import Isolated
from .source import END_WITHIN, HISTORY, Source
from .timed_scan import SourceKind

PERIOD = 0.1  # s between scans whose stamps do not grow
MEMORY = 1 << 30  # bytes of scans kept of one recording
BYTES_PER_BEAM = 60  # ranges, bearings, quality, times; xy and validity once they were asked for
PROGRESS_EVERY = 0.5  # s between reports of how much is loaded

logger = logging.getLogger(__name__)


class RecordingSource(Source):
    """A recording, checked by its first scan when made; the others follow in a thread once started.

    It is read in a process of its own. Raises RecordingError or TopicError if it cannot be played.
    """

    kind: SourceKind = "recording"

    def __init__(self, path: Path, topic: str | None = None) -> None:
        self._reading = Isolated(path.name, RecordingError, _read, path, topic)
        opened = next(self._reading)
        assert isinstance(opened, _Opened)
        self.name, self.format = path.name, opened.format
        self.topic, self.topics = opened.topic, opened.topics
        self._notes, self.mask = opened.notes, opened.mask
        self._cut: tuple[str, ...] = ()
        self._scans: list[Scan] = []
        self._times: list[float] = []
        self._closed = False
        self._thread: threading.Thread | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        return (*self._notes, *self._cut)

    @property
    def count(self) -> int:
        return len(self._times)

    @property
    def duration(self) -> float:
        return self._times[-1] if self._times else 0.0

    def nearest(self, index: int) -> int:
        return max(0, min(index, self.count - 1) if self.complete else index)

    def scan(self, index: int) -> Scan | None:
        return self._scans[index] if index < self.count else None

    def time(self, index: int) -> float:
        return self._times[index]

    def some(self) -> list[Scan]:
        last = self.count - 1
        places = np.unique(np.linspace(0, last, min(HISTORY, self.count)).astype(int)) if self.count else ()
        return [self._scans[place] for place in places]

    def start(self, arrived: Callable[[], None], progress: Callable[[], None]) -> None:
        self._thread = threading.Thread(
            target=self._load, args=(arrived, progress), name="loader", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        self._closed = True
        self._reading.kill()
        if self._thread:
            join(self._thread, END_WITHIN)
        else:
            self._reading.close()

    def _load(self, arrived: Callable[[], None], progress: Callable[[], None]) -> None:
        try:
            self._read(arrived, progress)
        except LidarError as error:
            self.error = None if self._closed else str(error)
        except Exception as error:
            logger.exception("reading %s", self.name)
            self.error = f"Reading stopped after {self.count} scans: {type(error).__name__}: {error}"
        finally:
            self._reading.close()
        self.complete = True
        arrived()
        progress()

    def _read(self, arrived: Callable[[], None], progress: Callable[[], None]) -> None:
        size, reported = 0, time.monotonic()
        for item in self._reading:
            if self._closed:
                return
            if not isinstance(item, dict):
                self._notes = item.notes
                continue
            scan = Scan(**item)
            self._append(scan)
            arrived()
            size += BYTES_PER_BEAM * len(scan)
            if size > MEMORY:
                self._cut = (f"only the first {self.count} scans are played: more would not fit in memory",)
                return
            if time.monotonic() - reported > PROGRESS_EVERY:
                reported = time.monotonic()
                progress()

    def _append(self, scan: Scan) -> None:
        """Play time follows the stamps; where they do not grow, PERIOD stands in."""
        step = scan.stamp - self._scans[-1].stamp if self._scans else 0.0
        self._scans.append(scan)
        self._times.append(self._times[-1] + (step if step > 0 else PERIOD) if self._times else 0.0)


def check_readable(path: Path) -> None:
    """Read the first scan. Raises RecordingError; several topics to choose from are fine."""
    with suppress(TopicError):
        RecordingSource(path).close()


@dataclass(frozen=True)
class _Opened:
    """A recording that has a first scan, and what is known of it so far."""

    format: str
    topic: str | None
    topics: tuple[str, ...]
    notes: tuple[str, ...]
    mask: tuple[Sector, ...]


def _read(path: Path, topic: str | None) -> Iterator["_Opened | dict[str, Any]"]:
    """What a recording is once its first scan is there, and again when there is more to note; its scans by field."""
    recording = open_recording(path, topic)
    mask, recording.mask = recording.mask, ()  # the pipeline applies it, since it can be changed
    told: _Opened | None = None
    for scan in recording:
        opened = _Opened(recording.name, recording.topic, recording.topics, recording.notes, mask)
        if opened != told:
            yield opened
        told = opened
        found = {field.name: getattr(scan, field.name) for field in fields(scan)}
        if recording.is_corrected:  # the estimate is made of these poses: nothing to judge it by
            found["truth"] = None
        yield found
    yield _Opened(recording.name, recording.topic, recording.topics, recording.notes, mask)
