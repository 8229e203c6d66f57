"""Capsules that follow each other, cut into revolutions where their angle passes the front."""

from itertools import compress
from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Ints
from lidarcore.rplidar.decoding.clock import SampleClock
from lidarcore.rplidar.decoding.counts import Counts
from lidarcore.rplidar.decoding.payloads import Decoder
from lidarcore.rplidar.decoding.revolution import TURN, Revolution

TURN_Q8 = 360 << 8  # 1/256 degree


class Sweep(NamedTuple):
    """A capsule whose end is known.

    start      1/256 degree, within the turn; of its first sample
    width      1/256 degree, that its samples are spread over
    number     of the capsule in the stream, counting those lost
    capsule    its bytes
    following  bytes of the next capsule, None if that was lost
    """

    start: int
    width: int
    number: int
    capsule: bytes
    following: bytes | None


class Turns:
    """Collects sweeps, puts revolutions into `completed`; what comes before the front is first passed is left out.

    What lies between two sweeps is a gap. Turns of which nothing is there are left out. Holds less than two turns.
    """

    def __init__(self, decode: Decoder, samples: int, clock: SampleClock, counts: Counts) -> None:
        self._decode, self._samples, self._clock, self._counts = decode, samples, clock, counts
        self.completed: list[Revolution] = []
        self._starts: list[int] = []  # 1/256 degree in the present turn: negative if begun in the one before
        self._sweeps: list[Sweep] = []
        self._begun = False

    def add(self, sweep: Sweep, arrival: float) -> None:
        """The next sweep, and when its end became known."""
        start = self._start(sweep)
        if start >= 2 * TURN_Q8:
            self.cut(arrival)
            start = sweep.start
        self._starts.append(start)
        self._sweeps.append(sweep)
        last = (start << 8) + (self._samples - 1) * ((sweep.width << 8) // self._samples)
        if last >= TURN:
            self._finish(arrival)
            beyond = [
                at + width > TURN_Q8 for at, (_, width, *_) in zip(self._starts, self._sweeps, strict=True)
            ]
            self._starts = [at - TURN_Q8 for at in compress(self._starts, beyond)]
            self._sweeps = list(compress(self._sweeps, beyond))
            self._begun = True

    def _start(self, sweep: Sweep) -> int:
        """1/256 degree in the present turn, of which its number says how many more have passed."""
        if not self._sweeps:
            return sweep.start
        about = self._starts[-1] + (sweep.number - self._sweeps[-1].number) * sweep.width
        return sweep.start + round((about - sweep.start) / TURN_Q8) * TURN_Q8

    def cut(self, arrival: float) -> None:
        """Turns may be missing here: what is there is a revolution, and what comes is another."""
        if self._sweeps:
            self._finish(arrival)
        self._starts, self._sweeps = [], []

    def restart(self) -> None:
        """Forget what is there, and leave out what comes before the front."""
        self._counts.partial_samples += len(self._sweeps) * self._samples
        self._starts, self._sweeps, self._begun = [], [], False

    def _finish(self, arrival: float) -> None:
        sweeps, starts = self._sweeps, np.array(self._starts)
        widths = np.array([sweep.width for sweep in sweeps])
        order = np.arange(self._samples)
        angles = (starts << 8)[:, None] + ((widths << 8) // self._samples)[:, None] * order
        first, last = np.searchsorted(angles.ravel(), (0, TURN)).tolist()
        if not self._begun:
            self._counts.partial_samples += last - first
        elif first < last:
            distances, lags = self._decode(
                [sweep.capsule for sweep in sweeps], [sweep.following for sweep in sweeps]
            )
            numbers = np.array([sweep.number for sweep in sweeps])
            times = self._clock.times(numbers[:, None] * self._samples + order)
            inside, gaps = slice(first, last), _gaps(starts, widths)
            self.completed.append(
                Revolution(
                    ((angles - lags) % TURN).ravel()[inside],
                    distances.ravel()[inside],
                    times.ravel()[inside],
                    None,
                    gaps,
                    arrival,
                )
            )


def _gaps(starts: Ints, widths: Ints) -> Ints:
    """(G, 2) 1/65536 degree: what no sweep covers of the turn."""
    begins = np.minimum(np.append(starts, TURN_Q8), TURN_Q8)
    ends = np.maximum(np.append(0, starts + widths), 0)
    lost = begins > ends
    return np.stack([ends[lost], begins[lost]], -1) << 8
