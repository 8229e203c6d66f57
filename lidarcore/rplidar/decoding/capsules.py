"""Which capsules of a stream follow each other, by the angle from one to the next."""

from typing import NamedTuple

from lidarcore.rplidar.answers import Answer
from lidarcore.rplidar.decoding.clock import SampleClock
from lidarcore.rplidar.decoding.counts import Counts
from lidarcore.rplidar.decoding.packets import FORMATS
from lidarcore.rplidar.decoding.payloads import DECODERS
from lidarcore.rplidar.decoding.turns import TURN_Q8, Sweep, Turns

RESTARTED = 1 << 15  # bit of the start angle: first capsule of a scan, or the sensor lost its angle
TOLERANCE = 0.1
"""Part of the present step by which the next may differ. From 480 to 900 rpm in half a second it does by 0.01."""
MOST_LOST = 8
"""Capsules lost in a row up to which the one before keeps its share of the angle."""
SMALLEST_STEP, LARGEST_STEP = TURN_Q8 // 1024, TURN_Q8 // 3
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
    first keeps its share. What is no multiple apart does not fit. What is closer, neither late nor with anything wrong
    between, cannot come from a loss: the step was wrong, and with it the turn so far. A checksum of 8 bits
    lets one of 256 pass: a capsule alone in garbage is not believed, nor one after which bytes are missing, which may
    be the halves of two.

    Capsules are numbered by their angle from the last one that fitted, and by the bytes between how many turns that
    were. More turns are missing where capsules are late by half of one or more, and stay so.
    """

    def __init__(self, answer: Answer, clock: SampleClock, counts: Counts) -> None:
        self._format, self._clock, self._counts = FORMATS[answer], clock, counts
        self._turns = Turns(DECODERS[answer], self._format.samples, clock, counts)
        self.completed = self._turns.completed
        self._known_start = self._known_number = 0  # of the last capsule that fitted
        self._bytes = self._capsules = 0  # since then
        self._next = 0  # number of the sweep that would leave no gap
        self._held_since, self._held_late, self._unsure = 0.0, 0.0, False
        self.restart()

    def restart(self) -> None:
        """Forget the stream so far: the next capsule has nothing to do with it."""
        self._previous: Capsule | None = None
        self._doubtful: Sweep | None = None
        self._forget()

    def _forget(self) -> None:
        """What was believed was wrong, or is no longer so."""
        self._turns.restart()
        self._clock.reset()
        self._held: list[Sweep] = []
        self._step = 0.0

    def add(self, skipped: int, data: bytes, arrival: float, behind: int) -> None:
        """The next intact capsule, how many bytes before it belonged to none, how many bytes were found behind it."""
        size, word = self._format.size, int.from_bytes(data[2:4], "little")
        start = (word & ~RESTARTED) << 2
        self._bytes += skipped + size
        self._capsules += 1
        if start >= TURN_Q8:
            self._counts.drop("unfit_packets")
            return
        if word & RESTARTED and not skipped:
            self.restart()
        elif skipped and self._previous and self._breaks(self._previous, skipped):
            self._counts.drop("unfit_packets")
            self._previous = self._doubtful = None
        capsule = Capsule(start, self._number(start), data, arrival, skipped > 0)
        previous, self._previous = self._previous, capsule
        if previous:
            self._follow(previous, capsule, behind // size)

    def _breaks(self, previous: Capsule, skipped: int) -> bool:
        """After so many bytes that belong to no capsule, the one before them is not to be used."""
        size = self._format.size
        return previous.after_garbage or skipped % size > 0 or skipped > (MOST_LOST + 1) * size

    def _number(self, start: int) -> int:
        """Which capsule of the stream has this start angle, if nothing is missing but what the bytes tell."""
        if not self._step:
            return self._known_number + 1
        turned = (start - self._known_start) % TURN_Q8
        turns = max(round((self._bytes / self._format.size * self._step - turned) / TURN_Q8), 0)
        return self._known_number + max(round((turned + turns * TURN_Q8) / self._step), 1)

    def _turn_time(self) -> float:
        return TURN_Q8 / self._step * self._format.samples * self._clock.period

    def _samples(self, number: int) -> int:
        """How many samples there have been at the end of this capsule."""
        return (number + 1) * self._format.samples

    def _follow(self, previous: Capsule, capsule: Capsule, behind: int) -> None:
        """Judge a pair."""
        turned = (capsule.start - previous.start) % TURN_Q8
        steps = max(round(turned / self._step), 1) if self._step else 0
        near = abs(turned - steps * self._step) <= TOLERANCE * self._step
        late = self._clock.late(self._samples(capsule.number + behind), capsule.arrival)
        doubtful, self._doubtful = self._doubtful, None
        if near and 0 < steps <= MOST_LOST + 1:
            self._counts.drop("unfit_packets", doubtful is not None)
            capsule = capsule._replace(number=previous.number + steps)
            self._accept(previous, capsule, turned // steps, late)
            return
        sweep = Sweep(previous.start, turned, previous.number, previous.data, capsule.data)
        if doubtful and abs(turned - doubtful.width) <= TOLERANCE * doubtful.width:
            self._learn(doubtful, sweep, capsule)
        else:
            self._counts.drop("unfit_packets", doubtful is not None)
            self._doubt(sweep, capsule, late)

    def _accept(self, previous: Capsule, capsule: Capsule, width: int, late: float) -> None:
        """A pair that fits. While its second may be turns further than its angle says, it and what follows are held."""
        lost = capsule.number - previous.number - 1
        sweep = Sweep(previous.start, width, previous.number, previous.data, None if lost else capsule.data)
        gap = sweep.number - self._next
        self._counts.drop("missing_packets", max(capsule.number - self._known_number - self._capsules, 0))
        self._known(sweep, capsule)
        half = self._turn_time() / 2
        unsure = lost > 0 or capsule.arrival - previous.arrival > half
        if not unsure:
            self._step += (width - self._step) / 8
        if (gap or unsure) and late > half and not self._explained(late):
            self._suspect(sweep, unsure, late, capsule)
        elif self._held:
            self._hold(sweep, late, capsule)
        else:
            self._turns.add(sweep, capsule.arrival)

    def _known(self, sweep: Sweep, capsule: Capsule) -> None:
        """The newest capsule fits to the end of a sweep."""
        self._previous = capsule
        self._known_start, self._known_number = capsule.start, capsule.number
        self._bytes = self._capsules = 0
        self._next = sweep.number + 1
        self._clock.arrived(self._samples(capsule.number), capsule.arrival)

    def _explained(self, late: float) -> bool:
        """Whether the delay is that before the held sweep: no more turns are missing, and no reader is catching up."""
        return len(self._held) > 0 and abs(late - self._held_late) < self._turn_time() / 2

    def _suspect(self, sweep: Sweep, unsure: bool, late: float, capsule: Capsule) -> None:
        """Hold a sweep before which turns may be missing, or within which, if `unsure`."""
        again = len(self._held) > 0
        if again:
            self._condemn(late, capsule)
            self._turns.cut(capsule.arrival)
        self._held, self._unsure, self._held_since, self._held_late = [sweep], unsure, capsule.arrival, late
        if again:  # without the clock, nothing will ever tell
            self._condemn(0.0, capsule)

    def _hold(self, sweep: Sweep, late: float, capsule: Capsule) -> None:
        """Hold another sweep, until the reader has caught up or should have."""
        self._held.append(sweep)
        if late <= self._turn_time() / 2:
            self._release(capsule.arrival)
        elif capsule.arrival - self._held_since > BACKLOG or len(self._held) > MOST_HELD:
            self._condemn(late, capsule)

    def _release(self, arrival: float) -> None:
        """What is held is where its angles say."""
        for sweep in self._held:
            self._turns.add(sweep, arrival)
        self._held = []

    def _condemn(self, late: float, capsule: Capsule) -> None:
        """What is held is of a later turn, but for a sweep within which turns are missing: that has no end."""
        turns = round(late / self._turn_time())
        self._counts.drop("missing_packets", round(turns * TURN_Q8 / self._step))
        self._turns.cut(capsule.arrival)
        self._clock.reset()
        self._clock.arrived(self._samples(capsule.number), capsule.arrival)
        if self._unsure:
            self._counts.drop("unfit_packets")
            del self._held[0]
        self._release(capsule.arrival)

    def _learn(self, doubtful: Sweep, sweep: Sweep, capsule: Capsule) -> None:
        """Two steps that agree with each other, and not with the one believed."""
        self._forget()
        self._step = sweep.width
        sweep = sweep._replace(number=doubtful.number + 1)
        self._turns.add(doubtful, capsule.arrival)
        self._turns.add(sweep, capsule.arrival)
        self._known(sweep, capsule._replace(number=sweep.number + 1))

    def _doubt(self, sweep: Sweep, capsule: Capsule, late: float) -> None:
        """Wait for what the next pair says; if this one is too close, what was believed was wrong."""
        if sweep.width < self._step and not capsule.after_garbage and late <= self._turn_time() / 2:
            self._forget()
        if SMALLEST_STEP <= sweep.width <= LARGEST_STEP:
            self._doubtful = sweep
        else:
            self._counts.drop("unfit_packets")
