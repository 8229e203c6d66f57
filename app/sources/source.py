"""Where scans come from: what every source offers."""

import time
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from lidarcore import DeviceError, Scan, SensorNoise
from lidarcore.body_mask import Sector
from lidarcore.rplidar import State

from .timed_scan import SourceKind

HISTORY = 200  # scans kept of a live source for stepping back
END_WITHIN = 2.0  # s that a thread may take to notice that its source was closed


@dataclass(frozen=True, slots=True)
class DeviceStatus:
    """A sensor, what it said of itself, and how well its measurements arrive.

    `checked` tells whether its packets carry a checksum in this mode: without, wrong distances cannot be noticed.
    """

    port: str
    name: str
    serial: str
    firmware: str
    hardware: int
    health: str
    mode: str
    checked: bool
    modes: tuple[str, ...]
    rpm: int
    baud: int
    state: State
    error: str | None
    rate_hz: float
    samples_per_s: float
    completeness: float
    bytes: int
    revolutions: int
    reconnects: int
    overruns: int
    dropped: dict[str, int]


class Source(Protocol):
    """Scans by index, from 0. A live one shows each as it comes, not by its stamp."""

    kind: SourceKind
    live: bool = False
    name: str | None = None
    topic: str | None = None
    topics: tuple[str, ...] = ()
    format: str | None = None
    error: str | None = None
    complete: bool = False
    noise: SensorNoise = SensorNoise()
    """What the sensor errs by, as far as that is known before it is calibrated."""

    mask: tuple[Sector, ...] = ()
    """Where the robot's own body is seen, as the recording has kept it. Its scans are still with it."""

    @property
    def sensor(self) -> str:
        """Which sensor took the scans: noise is set, and remembered, for each of its own."""
        return " ".join(filter(None, (self.kind, self.name, self.topic)))

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

    @abstractmethod
    def some(self) -> list[Scan]:
        """At most HISTORY of those that can be shown: of a live source the last ones, of a recording from all over."""

    def arrival(self, index: int) -> float:
        """When its last byte came, time.monotonic() s; for one that is not live, now."""
        return time.monotonic()

    def device(self) -> DeviceStatus | None:
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
