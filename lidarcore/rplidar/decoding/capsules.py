"""Which capsules of a stream follow each other, by the angle from one to the next."""

from typing import NamedTuple

from lidarcore.rplidar.answers import Answer
from lidarcore.rplidar.decoding.clock import SampleClock
from lidarcore.rplidar.decoding.contents import DECODERS
from lidarcore.rplidar.decoding.counts import Counts
from lidarcore.rplidar.decoding.packets import FORMATS
from lidarcore.rplidar.decoding.turns import TURN_Q8, Sweep, Turns

RESTARTED = 1 << 15  # bit of the start angle: first capsule of a scan, or the sensor lost its angle
TOLERANCE = 0.1
"""Part of the present step by which the next may differ. From 480 to 900 rpm in half a second it does by 0.01."""
MOST_LOST = 8
"""Capsules lost in a row up to which a turn goes on with a gap: about half of it."""
SMALLEST_STEP, LARGEST_STEP = TURN_Q8 // 1024, TURN_Q8 // 3
LATE = 0.05
"""s: less than a turn. After a gap or a pause, a capsule as late as this may be turns further than its angle says."""
BACKLOG = 0.02
"""s within which a reader that was away has read what had arrived meanwhile, and nothing is late any more."""
MOST_HELD = 512


class Capsule(NamedTuple):
    """An intact capsule: start angle (1/256 degree), number in the stream, bytes, arrival (s); what was before it."""

    start: int
    number: int
    data: bytes
    arrival: float
    after_garbage: bool


class CapsuleSequence:
    """Takes capsules, puts revolutions into `completed`.

    The samples of a capsule lie between it and the next one. The step from one to the next (1/256 degree) is learnt
    from two that agree, and followed. What is twice, three times ... as far apart has lost what was between, and the
    first keeps its share. What is no multiple apart does not fit. What is closer, with nothing wrong between, cannot
    come from a loss: the step was wrong, and with it the turn so far. A checksum of 8 bits
    lets one of 256 pass: a capsule alone in garbage is not believed, nor one after which bytes are missing, which may
    be the halves of two.
    """

    def __init__(self, answer: Answer, clock: SampleClock, counts: Counts) -> None:
        self._format, self._clock, self._counts = FORMATS[answer], clock, counts
        self._turns = Turns(DECODERS[answer], self._format.samples, clock, counts)
        self.completed = self._turns.completed
        self._number = self._next = 0  # of the newest capsule; of the sweep that would leave no gap
        self._held_since, self._unsure = 0.0, False
        self.restart()

    def restart(self) -> None:
        """The stream begins anew, anywhere."""
        self._turns.restart()
        self._clock.reset()
        self._previous: Capsule | None = None
        self._doubtful: Sweep | None = None
        self._held: list[Sweep] = []
        self._step = 0.0

    def add(self, skipped: int, data: bytes, arrival: float, behind: int) -> None:
        """The next intact capsule, how many bytes before it belonged to none, how many bytes were found behind it."""
        word = int.from_bytes(data[2:4], "little")
        start = (word & ~RESTARTED) << 2
        if start >= TURN_Q8:
            self._counts.drop("unfit_packets")
            return
        if word & RESTARTED and not skipped:
            self.restart()
        elif skipped > (MOST_LOST + 1) * self._format.size:
            self._cut(arrival)
            self._clock.reset()
            self._previous = self._doubtful = None
        elif skipped and self._previous and (self._previous.after_garbage or skipped % self._format.size):
            self._counts.drop("unfit_packets")
            self._previous = self._doubtful = None
        capsule = Capsule(start, self._number + 1 + skipped // self._format.size, data, arrival, skipped > 0)
        if self._previous:
            capsule = self._follow(self._previous, capsule, behind // self._format.size)
        self._previous, self._number = capsule, capsule.number
        self._clock.arrived(self._samples(capsule.number), arrival)

    def _samples(self, number: int) -> int:
        """How many samples there have been at the end of this capsule."""
        return (number + 1) * self._format.samples

    def _follow(self, previous: Capsule, capsule: Capsule, behind: int) -> Capsule:
        """Judge a pair; the second one, with the number that its angle says."""
        turned = (capsule.start - previous.start) % TURN_Q8
        steps = max(round(turned / self._step), 1) if self._step else 1
        near = abs(turned - steps * self._step) <= TOLERANCE * self._step
        capsule = capsule._replace(number=previous.number + steps)
        doubtful, self._doubtful = self._doubtful, None
        if self._step and near and steps <= MOST_LOST + 1:
            self._counts.drop("unfit_packets", doubtful is not None)
            self._accept(previous, capsule, turned // steps, behind)
            return capsule
        sweep = Sweep(previous.start, turned, previous.number, previous.data, capsule.data)
        if doubtful and abs(turned - doubtful.width) <= TOLERANCE * doubtful.width:
            self._learn(doubtful, sweep, capsule.arrival)
        else:
            self._counts.drop("unfit_packets", doubtful is not None)
            self._doubt(sweep, capsule)
        return capsule

    def _accept(self, previous: Capsule, capsule: Capsule, width: int, behind: int) -> None:
        """A pair that fits. While its second may be turns further than its angle says, it and what follows are held."""
        self._step += (width - self._step) / 8
        lost = capsule.number - previous.number - 1
        self._counts.drop("missing_packets", lost)
        sweep = Sweep(previous.start, width, previous.number, previous.data, None if lost else capsule.data)
        gap, self._next = sweep.number - self._next, sweep.number + 1
        if gap * self._step > TURN_Q8 // 2:
            self._cut(capsule.arrival)
        unsure = lost > 0 or capsule.arrival - previous.arrival > LATE
        late = self._clock.late(self._samples(capsule.number + behind), capsule.arrival) > LATE
        if late and (gap or unsure):
            self._suspect(sweep, unsure, capsule)
        elif self._held:
            self._hold(sweep, late, capsule)
        else:
            self._turns.add(sweep, capsule.arrival)

    def _suspect(self, sweep: Sweep, unsure: bool, capsule: Capsule) -> None:
        """Hold a sweep before which turns may be missing, or within which, if `unsure`."""
        again = len(self._held) > 0
        if again:
            self._condemn(capsule)
            self._turns.cut(capsule.arrival)
        self._held, self._unsure, self._held_since = [sweep], unsure, capsule.arrival
        if again:  # without the clock, nothing will ever tell
            self._condemn(capsule)

    def _hold(self, sweep: Sweep, late: bool, capsule: Capsule) -> None:
        """Hold another sweep, until the reader has caught up or should have."""
        self._held.append(sweep)
        if not late:
            self._release(capsule.arrival)
        elif capsule.arrival - self._held_since > BACKLOG or len(self._held) > MOST_HELD:
            self._condemn(capsule)

    def _release(self, arrival: float) -> None:
        """What is held is where its angles say."""
        for sweep in self._held:
            self._turns.add(sweep, arrival)
        self._held = []

    def _condemn(self, capsule: Capsule) -> None:
        """What is held is of a later turn, but for a sweep within which turns are missing: that has no end."""
        self._turns.cut(capsule.arrival)
        self._clock.reset()
        self._clock.arrived(self._samples(capsule.number), capsule.arrival)
        if self._unsure:
            self._counts.drop("unfit_packets")
            del self._held[0]
        self._release(capsule.arrival)

    def _cut(self, arrival: float) -> None:
        """Turns may be missing after what has come so far."""
        self._release(arrival)
        self._turns.cut(arrival)

    def _learn(self, doubtful: Sweep, sweep: Sweep, arrival: float) -> None:
        """Two steps that agree with each other, and not with the one believed."""
        self._turns.restart()
        self._held = []
        self._step = sweep.width
        self._turns.add(doubtful, arrival)
        self._turns.add(sweep, arrival)
        self._next = sweep.number + 1

    def _doubt(self, sweep: Sweep, capsule: Capsule) -> None:
        """Wait for what the next pair says; if this one is too close, what was believed was wrong."""
        if sweep.width < self._step and not capsule.after_garbage:
            self._turns.restart()
            self._held = []
            self._step = 0.0
        if SMALLEST_STEP <= sweep.width <= LARGEST_STEP:
            self._doubtful = sweep
        else:
            self._counts.drop("unfit_packets")
