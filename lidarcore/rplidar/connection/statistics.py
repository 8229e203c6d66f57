"""How well the measurements arrive."""

import time
from collections import deque
from dataclasses import dataclass, field

from lidarcore.rplidar.decoding.counts import Counts
from lidarcore.rplidar.decoding.revolution import TURN, Revolution

RECENT = 10  # revolutions
STALE = 1.0  # s; older ones say nothing about now


@dataclass(frozen=True)
class Statistics:
    """Since the driver was entered, over all connections.

    bytes, revolutions, samples  received
    dropped        what the decoder dropped, by reason (see `Counts`)
    overruns       revolutions nobody took in time
    reconnects     connections after the first
    rate_hz        revolutions a second, of the last 10; 0 while none arrive
    samples_per_s  of the last 10 revolutions; 0 while none arrive
    completeness   share of the last 10 revolutions that arrived, 0 to 1; 0 while none arrive
    """

    bytes: int = 0
    revolutions: int = 0
    samples: int = 0
    dropped: dict[str, int] = field(default_factory=dict)
    overruns: int = 0
    reconnects: int = 0
    rate_hz: float = 0.0
    samples_per_s: float = 0.0
    completeness: float = 0.0


class Tally:
    """Collects what `Statistics` tells; one thread adds, any may ask."""

    def __init__(self) -> None:
        self._past, self._now = Counts(), Counts()  # of earlier connections, of this one
        self._connections = 0
        self._recent: deque[Revolution] = deque(maxlen=RECENT + 1)

    def begin(self, counts: Counts) -> None:
        """There is a new connection, whose decoder counts there."""
        self._past, self._now = self._past + self._now, counts
        self._connections += 1
        self._recent.clear()

    def add(self, revolution: Revolution) -> None:
        """Count a revolution that has arrived."""
        self._recent.append(revolution)

    def statistics(self, overruns: int) -> Statistics:
        """The statistics as of now."""
        total, recent = self._past + self._now, self._fresh()
        rate, samples = _rates(recent)
        return Statistics(
            bytes=total.bytes,
            revolutions=total.revolutions,
            samples=total.samples,
            dropped=dict(total.dropped),
            overruns=overruns,
            reconnects=max(self._connections - 1, 0),
            rate_hz=rate,
            samples_per_s=samples,
            completeness=_completeness(recent[-RECENT:]),
        )

    def _fresh(self) -> list[Revolution]:
        """The last ones; none if none arrive any more."""
        recent = list(self._recent)
        return recent if recent and time.monotonic() - recent[-1].arrival <= STALE else []


def _rates(recent: list[Revolution]) -> tuple[float, float]:
    """Revolutions and samples a second; 0 if that cannot be told."""
    if len(recent) < 2:
        return 0.0, 0.0
    duration = float(recent[-1].times[0] - recent[0].times[0])
    if duration <= 0:
        return 0.0, 0.0
    return (len(recent) - 1) / duration, sum(map(len, recent[:-1])) / duration


def _completeness(recent: list[Revolution]) -> float:
    """Share of the turns that arrived."""
    lost = sum(float(((revolution.gaps[:, 1] - revolution.gaps[:, 0]) % TURN).sum()) for revolution in recent)
    return 1 - lost / (len(recent) * TURN) if recent else 0.0
