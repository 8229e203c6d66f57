"""From the bytes of a scan to revolutions."""

from lidarcore.rplidar.answers import Answer
from lidarcore.rplidar.decoding.capsules import CapsuleSequence
from lidarcore.rplidar.decoding.clock import SampleClock
from lidarcore.rplidar.decoding.counts import Counts
from lidarcore.rplidar.decoding.nodes import NodeSequence
from lidarcore.rplidar.decoding.packets import FORMATS, PacketFinder
from lidarcore.rplidar.decoding.revolution import Revolution

BITS_PER_BYTE = 10  # start and stop bit


class StreamDecoder:
    """Takes what comes after the descriptor of a scan, in any fragments; gives revolutions as they are completed.

    Never raises on data: what cannot be used is dropped and counted in `statistics`. A loss leaves a gap in the
    revolution; where nobody can tell how much was lost, the revolution ends there, and what follows is another one.

    Raises ValueError for an answer type that is no scan, or a sample period or baud rate that is not positive.
    """

    def __init__(self, answer_type: int, us_per_sample: float, baud: int = 256000) -> None:
        if answer_type not in FORMATS:
            known = ", ".join(f"{answer:#x} ({answer.name})" for answer in FORMATS)
            raise ValueError(f"answer type {answer_type:#x} is not a scan this decodes: {known}")
        if not (us_per_sample > 0 and baud > 0):
            raise ValueError(f"{us_per_sample} us per sample at {baud} baud: give positive numbers")
        answer = Answer(answer_type)
        layout, period = FORMATS[answer], us_per_sample / 1e6
        self.statistics = Counts()
        clock = SampleClock(period, layout.size * BITS_PER_BYTE / baud)
        self._finder = PacketFinder(layout, self.statistics)
        sequence = NodeSequence if answer in (Answer.NODES, Answer.HQ) else CapsuleSequence
        self._sequence = sequence(answer, clock, self.statistics)
        self._size = layout.size

    def feed(self, data: bytes, arrival: float) -> list[Revolution]:
        """Revolutions that these bytes complete.

        arrival  s, when they were read, on a clock that never goes back
        """
        counts, runs = self.statistics, self._finder.feed(data)
        counts.bytes += len(data)
        behind = self._finder.waiting + sum(len(packets) for _, packets in runs)
        for skipped, packets in runs:
            behind -= len(packets)
            counts.packets += len(packets) // self._size
            self._sequence.add(skipped, packets, arrival, behind)
        revolutions = self._sequence.completed.copy()
        self._sequence.completed.clear()
        counts.revolutions += len(revolutions)
        counts.samples += sum(map(len, revolutions))
        return revolutions
