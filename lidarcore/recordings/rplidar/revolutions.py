"""Revolutions of an RPLIDAR as its tools write them: degrees clockwise, millimetres, no stamps."""

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import chain
from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array
from lidarcore.recordings.base import Recording
from lidarcore.recordings.pace import NOMINAL_PERIOD
from lidarcore.scan import Scan

WHOLE = 0.75
"""A first or last revolution that sweeps less than this part of its neighbour was cut by start or stop."""


class Revolution(NamedTuple):
    """Samples (N, 2 or 3): angle deg clockwise, distance mm, and quality if there is one; the station they are from."""

    samples: Array
    station: float = 0.0


class RplidarRecording(Recording):
    """Samples of an RPLIDAR, revolution by revolution."""

    sensor = "RPLIDAR"

    @abstractmethod
    def _revolutions(self) -> Iterator[Revolution]:
        """Yield the samples between two starts of a revolution, in the order of the file."""

    def _open(self, topic: str | None) -> None:
        self._choose((), topic)
        self._remark("Angles run clockwise and distances are in mm: turned to counter-clockwise, metres.")
        self._remark(f"There are no stamps: revolutions are taken to be {NOMINAL_PERIOD} s apart.")

    def _scans(self) -> Iterator[Callable[[], Scan]]:
        station = None
        for index, revolution in enumerate(self._whole(map(self._checked, self._revolutions()))):
            if revolution.station != station:
                station = revolution.station
                self._stations.append(index)
            yield partial(_scan, revolution.samples, NOMINAL_PERIOD * index)

    def _checked(self, revolution: Revolution) -> Revolution:
        """The samples whose angle is one."""
        samples = revolution.samples
        self._check_beams(len(samples))
        sound = (samples[:, 0] >= 0) & (samples[:, 0] <= 360)
        self._count("samples with an angle outside 0..360 degrees left out", int(np.sum(~sound)))
        return revolution._replace(samples=samples[sound])

    def _whole(self, revolutions: Iterable[Revolution]) -> Iterator[Revolution]:
        """Leave out the first and the last revolution if they are partial."""
        before, current = None, None
        for after in chain(revolutions, [None]):
            if current is not None:
                neighbours = [sweep(other.samples) for other in (before, after) if other is not None]
                at_end = before is None or after is None
                if at_end and neighbours and sweep(current.samples) < WHOLE * max(neighbours):
                    self._count("partial revolutions at the start or end left out", 1)
                else:
                    yield current
            before, current = current, after


def sweep(revolution: Array) -> float:
    """Degrees that a revolution (N, 2 or 3) sweeps, forward minus backward."""
    steps = np.diff(revolution[:, 0])
    return float(np.sum((steps + 180) % 360 - 180))


def _scan(revolution: Array, stamp: float) -> Scan:
    bearings = -np.radians(revolution[::-1, 0])
    bearings[bearings <= -np.pi] += 2 * np.pi
    quality = revolution[::-1, 2] if revolution.shape[1] > 2 else None
    return Scan(revolution[::-1, 1] / 1000, bearings, stamp, quality)
