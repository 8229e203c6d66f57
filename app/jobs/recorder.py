"""Recording beside the live view: threads write, and neither a slow nor a full disk ever holds up the caller."""

import threading
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from lidarcore import Features, LidarError, Scan
from lidarcore.body_mask import Sector
from lidarcore.recordings import ELLIPSE_SCALE, RecordingWriter
from lidarcore.rplidar import CaptureWriter, Direction, Piece, Stream

from ..errors import ConflictError
from .spooler import Spooler

WAITING_SCANS = 100  # 10 s of a lidar at 10 Hz
WAITING_READS = 4000  # of the port: 17 s of an S1
RATE_OVER = 3.0  # s over which the rate is taken


@dataclass(frozen=True, slots=True)
class RecorderStatus:
    """What is recorded, or was recorded last. Sizes in bytes, times in s, the rate in bytes/s."""

    state: Literal["idle", "recording", "failed"] = "idle"
    name: str | None = None
    raw: bool = False
    size: int = 0
    duration: float = 0.0
    scans: int = 0
    rate: float = 0.0
    dropped: int = 0
    error: str | None = None


class _Recording:
    """One recording: its files, and the threads that write them."""

    def __init__(
        self, path: Path, raw: Path | None, stream: Stream, sensor: str, ellipse_scale: float
    ) -> None:
        self.name, self.running = path.name, True
        self.paths = (path, raw) if raw else (path,)
        self.error: str | None = None
        self.writer = RecordingWriter(path, sensor=sensor, ellipse_scale=ellipse_scale)
        try:
            self._capture = CaptureWriter(raw, stream) if raw else None
        except LidarError:
            self.writer.close()
            raise
        self._sizes, self._lock = deque([(time.monotonic(), 0)]), threading.Lock()
        self.scans = self._spooling(self.writer)
        self.reads = self._capturing(self._capture) if self._capture else None
        self._spoolers: list[Spooler[Any]] = [self.scans, *([self.reads] if self.reads else [])]
        for spooler in self._spoolers:
            spooler.start()

    @property
    def is_closed(self) -> bool:
        """Everything is on the disk: nobody writes into the files any more."""
        return not any(spooler.is_alive() for spooler in self._spoolers)

    def end(self) -> None:
        """Take nothing more; what waits is still written."""
        self.running = False
        for spooler in self._spoolers:
            spooler.end()

    def join(self) -> None:
        if not all([spooler.join() for spooler in self._spoolers]):
            self.error = (
                self.error or f"{self.name} is not complete yet: the disk is slow, and goes on writing."
            )

    def status(self) -> RecorderStatus:
        size = self.writer.size + (self._capture.size if self._capture else 0)
        return RecorderStatus(
            state="failed" if self.error else "recording" if self.running else "idle",
            name=self.name,
            raw=self._capture is not None,
            size=size,
            duration=self.writer.duration,
            scans=self.writer.scans,
            rate=self._rate(size),
            dropped=sum(spooler.dropped for spooler in self._spoolers),
            error=self.error,
        )

    def _spooling(self, to: RecordingWriter) -> Spooler[tuple[Scan, Features | None, tuple[Sector, ...]]]:
        return Spooler(WAITING_SCANS, lambda item: to.write(*item), to.flush, to.close, self._fail)

    def _capturing(self, to: CaptureWriter) -> Spooler[Piece]:
        return Spooler(WAITING_READS, lambda piece: to.write(*piece), lambda: None, to.close, self._fail)

    def _fail(self, error: str) -> None:
        self.error = self.error or error
        self.end()

    def _rate(self, size: int) -> float:
        """Bytes per second: over the last seconds while recording, then of the whole."""
        if not self.running:
            return size / self.writer.duration if self.writer.duration else 0.0
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
        self._recording: _Recording | None = None
        self._lock = threading.Lock()

    @property
    def running(self) -> bool:
        """Whether a recording runs."""
        return bool(self._recording and self._recording.running)

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that are being written."""
        recording = self._recording
        return () if recording is None or recording.is_closed else recording.paths

    @property
    def status(self) -> RecorderStatus:
        """What is recorded, or was recorded last."""
        return self._recording.status() if self._recording else RecorderStatus()

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
        Raises ConflictError while a recording runs, RecordingError if a file exists or cannot be created.
        """
        with self._lock:
            if self._recording and self._recording.running:
                raise ConflictError(f"{self._recording.name} is being recorded: stop that first.")
            self._recording = _Recording(path, raw, stream or Stream(), sensor, ellipse_scale)

    def put(self, scan: Scan, features: Features | None = None, mask: tuple[Sector, ...] = ()) -> None:
        """Record a scan as it was measured, and the mask that holds, if a recording runs. Returns at once."""
        if (recording := self._recording) and recording.running:
            recording.scans.put((scan, features, mask))

    def tap(self, direction: Direction, time: float, data: bytes) -> None:
        """Record bytes of the port, if a capture runs: the tap of a Driver. Returns at once."""
        if (recording := self._recording) and recording.running and recording.reads:
            recording.reads.put((direction, time, data))

    def stop(self) -> RecorderStatus:
        """End the recording, if one runs, and wait (bounded) until it is closed."""
        with self._lock:
            if self._recording:
                self._recording.end()
                self._recording.join()
        return self.status
