"""Where scans come from: what every source offers, and recordings, read ahead in the background."""

import logging
import threading
import time
from abc import abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from app.wire import DeviceJson, Kind
from lidarcore import DeviceError, LidarError, Scan, TopicError, open_recording

PERIOD = 0.1  # s between scans whose stamps do not grow
MEMORY = 1 << 30  # bytes of scans kept of one recording
BYTES_PER_BEAM = 60  # ranges, bearings, quality, times; xy and validity once they were asked for
PROGRESS_EVERY = 0.5  # s between reports of how much is loaded

logger = logging.getLogger(__name__)


class Source(Protocol):
    """Scans by index, from 0. A live one shows each as it comes, not by its stamp."""

    kind: Kind
    live: bool = False
    name: str | None = None
    topic: str | None = None
    topics: tuple[str, ...] = ()
    format: str | None = None
    error: str | None = None
    complete: bool = False

    @property
    def notes(self) -> tuple[str, ...]:
        return ()

    @property
    @abstractmethod
    def count(self) -> int:
        """How many there have been so far."""

    @property
    def duration(self) -> float | None:
        return None

    @abstractmethod
    def nearest(self, index: int) -> int:
        """The index closest to the one asked for that there is, or that may still come."""

    @abstractmethod
    def scan(self, index: int) -> Scan | None:
        """The scan, None if it is not there yet."""

    @abstractmethod
    def time(self, index: int) -> float:
        """Play time of a scan that is there, s since the first one."""

    def arrival(self, index: int) -> float:
        """When its last byte came, time.monotonic() s; for one that is not live, now."""
        return time.monotonic()

    def device(self) -> DeviceJson | None:
        """The sensor, if there is one."""
        return None

    def set_speed(self, rpm: int) -> None:
        """Turn the sensor at that speed. Raises DeviceError if there is none, or not at that one."""
        raise DeviceError("A recording has no motor: play a device or the emulator.")

    @abstractmethod
    def start(self, arrived: Callable[[], None], progress: Callable[[], None]) -> None:
        """Begin to read ahead; `arrived` is called after every scan, `progress` now and then."""

    @abstractmethod
    def close(self) -> None:
        """Stop reading."""


class RecordingSource(Source):
    """A recording, checked by its first scan when made; the others follow in a thread once started.

    Raises RecordingError or TopicError if it cannot be played.
    """

    kind: Kind = "recording"

    def __init__(self, path: Path, topic: str | None = None) -> None:
        self._recording = open_recording(path, topic)
        next(iter(self._recording))
        self.name, self.format = path.name, self._recording.name
        self.topic, self.topics = self._recording.topic, self._recording.topics
        self._cut: tuple[str, ...] = ()
        self._scans: list[Scan] = []
        self._times: list[float] = []
        self._closed = False

    @property
    def notes(self) -> tuple[str, ...]:
        return (*self._recording.notes, *self._cut)

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

    def start(self, arrived: Callable[[], None], progress: Callable[[], None]) -> None:
        threading.Thread(target=self._load, args=(arrived, progress), name="loader", daemon=True).start()

    def close(self) -> None:
        self._closed = True

    def _load(self, arrived: Callable[[], None], progress: Callable[[], None]) -> None:
        try:
            self._read(arrived, progress)
        except LidarError as error:
            self.error = str(error)
        except Exception as error:
            logger.exception("reading %s", self.name)
            self.error = f"Reading stopped after {self.count} scans: {type(error).__name__}: {error}"
        self.complete = True
        arrived()
        progress()

    def _read(self, arrived: Callable[[], None], progress: Callable[[], None]) -> None:
        size, reported = 0, time.monotonic()
        for scan in self._recording:
            if self._closed:
                return
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
    try:
        next(iter(open_recording(path)))
    except TopicError:
        return
