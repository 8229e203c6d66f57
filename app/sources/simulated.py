"""A simulated robot as a source: its scans come at the pace of a sensor, with odometry and the true pose."""

import threading
import time
from collections.abc import Callable

from lidarcore import Scan
from lidarcore.simulation.robot import RATE, SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

from .history import HistorySource
from .timed_scan import SourceKind

_LATE = 1.0  # s behind after which time lost is not made up for


class SimulationSource(HistorySource):
    """Endless scans of a simulated robot, RATE a second, stamped in Unix time."""

    kind: SourceKind = "simulation"

    def __init__(
        self, settings: SimulationSettings | None = None, tell: Callable[[Scan], None] = lambda scan: None
    ) -> None:
        super().__init__(tell)
        self.settings = settings or SimulationSettings()
        self.noise = self.settings.noise
        self._closed = threading.Event()

    def close(self) -> None:
        self._closed.set()
        super().close()

    def _follow(self) -> None:
        due = time.monotonic()
        for scan in SimulatedRobot(self.settings, begin=time.time()):
            due = max(due + 1 / RATE, time.monotonic() - _LATE)
            if self._closed.wait(max(due - time.monotonic(), 0)):
                return
            self._take(scan, time.monotonic())
