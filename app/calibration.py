"""Calibration beside the live view: scans of what plays are collected, then worked on in a thread."""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from app.calibration_wire import CalibrationJson, CalibrationStateJson, State, calibration_json
from app.frame import Frame
from app.player import Player
from app.sources import Source
from lidarcore import LidarError, Scan
from lidarcore.evaluation.calibration import LEAST_SCANS, calibrate

MOST_SCANS = 300
"""More take half a minute to come and seconds to work on, and tell hardly more."""
MOST_BEAMS = 1_000_000  # of all scans: dense ones need not be many
PATIENCE = 3.0  # s without a scan after which it is said what may be wrong

logger = logging.getLogger(__name__)


class CalibrationBusyError(LidarError):
    """One calibration at a time."""


@dataclass(slots=True, eq=False)
class _Job:
    """One calibration: what it is made of, how far it is, what came out."""

    source: Source | None = None
    name: str | None = None
    wanted: int = 0
    state: State = "idle"
    number: int = -1  # of the source, as `Taken` has it
    scans: dict[int, Scan] = field(default_factory=dict)  # by their index in the source
    count: int = 0
    beams: int = 0
    latest: float = field(default_factory=time.monotonic)
    message: str | None = None
    result: CalibrationJson | None = None

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
        self._lock = threading.Lock()

    def start(self, scans: int) -> None:
        """Collect so many scans of what plays, or all of a recording that has fewer.

        Raises CalibrationBusyError if one is under way.
        """
        with self._lock:
            if self._job.state in ("collecting", "calculating"):
                raise CalibrationBusyError("A calibration is under way: wait for its end, or cancel it.")
            source = self._player.source
            self._job = _Job(source, source.name or source.kind, scans, "collecting")

    def cancel(self) -> None:
        """Give up what is under way, and forget what was found."""
        with self._lock:
            self._job = _Job()

    def tell(self, frame: Frame) -> None:
        """Take the scan of this frame, unless it was taken: paused and looped sources show scans again."""
        with self._lock:
            job, taken = self._job, frame.taken
            if job.state != "collecting":
                return
            if taken.source != job.number:  # what was on its way when the source changed is left out
                job.scans.clear()
                job.number, job.beams = taken.source, 0
            if taken.position["index"] not in job.scans:
                job.latest = time.monotonic()
                job.scans[taken.position["index"]] = taken.scan
                job.beams += len(taken.scan)
            job.count = len(job.scans)
            if job.is_complete():
                job.state = "calculating"
                threading.Thread(target=self._calculate, args=(job,), name="calibration", daemon=True).start()

    def look(self) -> None:
        """Scans of one source say nothing on another one's noise: a change of it ends the collection."""
        with self._lock:
            if self._job.state == "collecting" and self._player.source is not self._job.source:
                _fail(self._job, "The source was changed while scans were collected: start again.")

    def status(self) -> CalibrationStateJson:
        """How far it is, and what was found."""
        with self._lock:
            job = self._job
            return {
                "state": job.state,
                "source": job.name,
                "scans": job.count,
                "wanted": job.wanted,
                "message": self._waits_for() if job.state == "collecting" else job.message,
                "result": job.result,
            }

    def _waits_for(self) -> str | None:
        if not self._ready():
            self._job.latest = time.monotonic()  # patience begins afterwards
            return "The kernels are still being compiled: scans are taken as soon as that is done."
        if time.monotonic() - self._job.latest > PATIENCE:
            return "No new scans come: is the source paused, at its end or unplugged?"
        return None

    def _calculate(self, job: _Job) -> None:
        try:
            result = calibration_json(calibrate(job.scans.values()))
        except LidarError as error:
            with self._lock:
                _fail(job, str(error))
        except Exception:
            logger.exception("calibration of %s", job.name)
            with self._lock:
                _fail(job, "An error in the server itself; its log says more.")
        else:
            with self._lock:
                job.state, job.result = "done", result
                job.scans.clear()


def _fail(job: _Job, message: str) -> None:
    job.state, job.message = "failed", message
    job.scans.clear()
