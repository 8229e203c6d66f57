"""Calibration beside the live view: scans of what plays are collected, then worked on in a thread."""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from lidarcore import LidarError, Scan
from lidarcore.evaluation.calibration.calibrate import LEAST_SCANS, calibrate
from lidarcore.threads import join

from ..errors import ConflictError
from ..pipeline.frame import Frame
from ..sources.player import Player
from ..sources.source import Source
from .calibration_report import CalibrationReport, report

MOST_SCANS = 300
"""More take half a minute to come and seconds to work on, and tell hardly more."""
MOST_BEAMS = 1_000_000  # of all scans: dense ones need not be many
END_WITHIN = 2.0  # s that the end of the server waits for a calculation
PATIENCE = 3.0  # s without a scan after which it is said what may be wrong

logger = logging.getLogger(__name__)


State = Literal["idle", "collecting", "calculating", "done", "failed"]


@dataclass(frozen=True, slots=True)
class CalibrationStatus:
    """How far it is: `scans` of `wanted` from a source; `message` says what it waits for, or what went wrong."""

    state: State
    source: str | None
    scans: int
    wanted: int
    message: str | None
    result: CalibrationReport | None


@dataclass(slots=True, eq=False)
class _Job:
    """One calibration: what it is made of, how far it is, what came out."""

    source: Source | None = None
    name: str | None = None
    wanted: int = 0
    state: State = "idle"
    number: int = -1  # of the source, as `TimedScan` has it
    scans: dict[int, Scan] = field(default_factory=dict)  # by their index in the source
    count: int = 0
    beams: int = 0
    latest: float = field(default_factory=time.monotonic)
    message: str | None = None
    result: CalibrationReport | None = None

    def is_complete(self) -> bool:
        """Whether there are scans enough, or all that there are."""
        source = self.source
        all_of_it = source is not None and source.complete and not source.live and self.count >= source.count
        many = self.count >= LEAST_SCANS and self.beams >= MOST_BEAMS
        return self.count >= self.wanted or all_of_it or many


class LiveCalibration:
    """Is told of every frame and of every change of source; any thread may call any method."""

    def __init__(self, player: Player, ready: Callable[[], bool]) -> None:
        """`ready` tells whether scans can come: kernels are compiled first."""
        self._player, self._ready = player, ready
        self._job = _Job()
        self._threads: list[threading.Thread] = []  # that calculate, also for jobs that were given up
        self._lock = threading.Lock()

    def start(self, scans: int) -> None:
        """Collect so many scans of what plays, or all of a recording that has fewer.

        Raises ConflictError if one is under way.
        """
        with self._lock:
            if self._job.state in ("collecting", "calculating"):
                raise ConflictError("A calibration is under way: wait for its end, or cancel it.")
            source = self._player.source
            self._job = _Job(source, source.name or source.kind, scans, "collecting")

    def close(self) -> None:
        """Give up, and wait for the end of what is being calculated."""
        self.cancel()
        for thread in self._threads:
            join(thread, END_WITHIN)

    def cancel(self) -> None:
        """Give up what is under way, and forget what was found."""
        with self._lock:
            self._job = _Job()

    def observe(self, frame: Frame) -> None:
        """Take the scan of this frame, unless it was taken: paused and looped sources show scans again."""
        with self._lock:
            job, timed = self._job, frame.timed
            if job.state != "collecting":
                return
            if timed.source != job.number:  # what was on its way when the source changed is left out
                job.scans.clear()
                job.number, job.beams = timed.source, 0
            if timed.position.index not in job.scans:
                job.latest = time.monotonic()
                job.scans[timed.position.index] = timed.scan
                job.beams += len(timed.scan)
            job.count = len(job.scans)
            if job.is_complete():
                self._begin_to_calculate(job)

    def _begin_to_calculate(self, job: _Job) -> None:
        job.state = "calculating"
        thread = threading.Thread(target=self._calculate, args=(job,), name="calibration", daemon=True)
        self._threads = [*(other for other in self._threads if other.is_alive()), thread]
        thread.start()

    def check_source(self) -> None:
        """Scans of one source say nothing on another one's noise: a change of it ends the collection."""
        with self._lock:
            if self._job.state == "collecting" and self._player.source is not self._job.source:
                self._job.state = "failed"
                self._job.message = "The source was changed while scans were collected: start again."
                self._job.scans.clear()

    def status(self) -> CalibrationStatus:
        """How far it is, and what was found."""
        with self._lock:
            job = self._job
            message = self._waits_for() if job.state == "collecting" else job.message
            return CalibrationStatus(job.state, job.name, job.count, job.wanted, message, job.result)

    def _waits_for(self) -> str | None:
        if not self._ready():
            self._job.latest = time.monotonic()  # patience begins afterwards
            return "The kernels are still being compiled: collecting starts afterwards."
        if time.monotonic() - self._job.latest > PATIENCE:
            return "No new scans arrive: is the source paused, ended or unplugged?"
        return None

    def _calculate(self, job: _Job) -> None:
        result, message = None, None
        try:
            result = report(calibrate(job.scans.values()))
        except LidarError as error:
            message = str(error)
        except Exception:
            logger.exception("calibration of %s", job.name)
            message = "The calibration failed because of an error in the server; see its log."
        with self._lock:
            job.state, job.result, job.message = "done" if result else "failed", result, message
            job.scans.clear()
