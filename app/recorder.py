"""Recording beside the live view: threads write, and neither a slow nor a full disk ever holds up the caller."""

import threading
import time
from collections import deque
from pathlib import Path
from typing import Any, Literal

from typing_extensions import TypedDict

from app.spooler import Spooler
from lidarcore import Features, LidarError, Scan
from lidarcore.recordings.writer import ELLIPSE_SCALE, RecordingWriter
from lidarcore.rplidar.capture import CaptureWriter, Direction, Piece, Stream

WAITING_SCANS = 100  # 10 s of a lidar at 10 Hz
WAITING_READS = 4000  # of the port: 17 s of an S1
RATE_OVER = 3.0  # s over which the rate is taken


class RecorderJson(TypedDict):
    """What is recorded, or was recorded last. Sizes in bytes, times in s."""

    state: Literal["idle", "recording", "failed"]
    name: str | None
    raw: bool
    size: int
    duration: float
    scans: int
    rate: float
    dropped: int
    error: str | None


NOTHING: RecorderJson = {
    "state": "idle",
    "name": None,
    "raw": False,
    "size": 0,
    "duration": 0.0,
    "scans": 0,
    "rate": 0.0,
    "dropped": 0,
    "error": None,
}


class RecorderBusyError(LidarError):
    """A recording is running already."""


class _Session:
    """One recording: its files, and the threads that write them."""

    def __init__(
        self, path: Path, raw: Path | None, stream: Stream, sensor: str, ellipse_scale: float
    ) -> None:
        self.name, self.running = path.name, True
        self.error: str | None = None
        self.recording = RecordingWriter(path, sensor=sensor, ellipse_scale=ellipse_scale)
        try:
            self._capture = CaptureWriter(raw, stream) if raw else None
        except LidarError:
            self.recording.close()
            raise
        self._sizes, self._lock = deque([(time.monotonic(), 0)]), threading.Lock()
        self.scans = self._spooling(self.recording)
        self.reads = self._capturing(self._capture) if self._capture else None
        self._spoolers: list[Spooler[Any]] = [self.scans, *([self.reads] if self.reads else [])]
        for spooler in self._spoolers:
            spooler.start()

    def end(self) -> None:
        """Take nothing more; what waits is still written."""
        self.running = False
        for spooler in self._spoolers:
            spooler.end()

    def join(self) -> None:
        for spooler in self._spoolers:
            spooler.join()

    def status(self) -> RecorderJson:
        size = self.recording.size + (self._capture.size if self._capture else 0)
        return {
            "state": "failed" if self.error else "recording" if self.running else "idle",
            "name": self.name,
            "raw": self._capture is not None,
            "size": size,
            "duration": self.recording.duration,
            "scans": self.recording.scans,
            "rate": self._rate(size),
            "dropped": sum(spooler.dropped for spooler in self._spoolers),
            "error": self.error,
        }

    def _spooling(self, to: RecordingWriter) -> Spooler[tuple[Scan, Features | None]]:
        return Spooler(WAITING_SCANS, lambda item: to.write(*item), to.flush, to.close, self._fail)

    def _capturing(self, to: CaptureWriter) -> Spooler[Piece]:
        return Spooler(WAITING_READS, lambda piece: to.write(*piece), lambda: None, to.close, self._fail)

    def _fail(self, error: str) -> None:
        self.error = self.error or error
        self.end()

    def _rate(self, size: int) -> float:
        """Bytes per second: over the last seconds while recording, then of the whole."""
        if not self.running:
            return size / self.recording.duration if self.recording.duration else 0.0
        now = time.monotonic()
        with self._lock:
            self._sizes.append((now, size))
            while len(self._sizes) > 2 and self._sizes[1][0] < now - RATE_OVER:
                self._sizes.popleft()
            begin, before = self._sizes[0]
        return (size - before) / max(now - begin, 1e-3)


class AsyncRecorder:
    """Records scans, and the bytes of the port if asked, into new files. Any thread may call any method.

    Only `start` raises: what goes wrong later, like a full disk, ends the recording and shows in `status`.
    """

    def __init__(self) -> None:
        self._session: _Session | None = None
        self._lock = threading.Lock()

    @property
    def running(self) -> bool:
        """Whether a recording runs."""
        return bool(self._session and self._session.running)

    @property
    def status(self) -> RecorderJson:
        """What is recorded, or was recorded last."""
        return self._session.status() if self._session else NOTHING.copy()

    def start(
        self,
        path: Path,
        *,
        raw: Path | None = None,
        stream: Stream | None = None,
        sensor: str = "RPLIDAR S1",
        ellipse_scale: float = ELLIPSE_SCALE,
    ) -> None:
        """Record into a new file from now on, and what `tap` gets into the capture `raw`.

        stream  what the sensor is sending already, for `raw`
        Raises RecorderBusyError while a recording runs, RecordingError if a file exists or cannot be created.
        """
        with self._lock:
            if self._session and self._session.running:
                raise RecorderBusyError(f"{self._session.name} is being recorded: stop that first.")
            self._session = _Session(path, raw, stream or Stream(), sensor, ellipse_scale)

    def put(self, scan: Scan, features: Features | None = None) -> None:
        """Record a scan, if a recording runs. Returns at once."""
        if (session := self._session) and session.running:
            session.scans.put((scan, features))

    def tap(self, direction: Direction, time: float, data: bytes) -> None:
        """Record bytes of the port, if a capture runs: the tap of a Driver. Returns at once."""
        if (session := self._session) and session.running and session.reads:
            session.reads.put((direction, time, data))

    def stop(self) -> RecorderJson:
        """End the recording, if one runs, and wait (bounded) until it is closed."""
        with self._lock:
            if self._session:
                self._session.end()
                self._session.join()
        return self.status
