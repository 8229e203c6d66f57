"""Nodes, each with an angle of its own, cut into revolutions where they say that one starts.

Legacy nodes (5 bytes) have no checksum: one whose angle leaps away and back, or is out of the order and spacing of the
turn, is left out, and where the node that starts a revolution was lost, the angle says so instead. Of nodes that never
came the spacing tells, too. Distances have nothing to be judged by.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lidarcore.arrays import Bools, Ints
from lidarcore.rplidar.answers import Answer
from lidarcore.rplidar.decoding.clock import SampleClock
from lidarcore.rplidar.decoding.counts import Counts
from lidarcore.rplidar.decoding.packets import FORMATS
from lidarcore.rplidar.decoding.revolution import TURN, Revolution
from lidarcore.rplidar.decoding.spacing import misfits, missing

DEGREE = 1 << 16
LEAP = 30 * DEGREE  # no two nodes in a row are this far apart, but for a loss
GAP = 10 * DEGREE  # neighbours this far apart have lost what was between; angles of an A1 jitter by up to 7
OVERDUE = TURN + 20 * DEGREE  # a turn this far that no node has ended
MOST_LOST = 150  # nodes in a row; after more, the next one may be in any later turn
MOST_NODES = 8192  # in a turn that does not end, because the sensor does not
CHUNK = 1024  # nodes looked at together, at most
FEW = 64  # nodes that wait for more, unless one of them starts a turn
LATE = 0.05  # s; after a gap, a node this late may be turns further than its angle says

ANGLE, DISTANCE, _, START, INDEX, AFTER_LOSS = range(6)
Nodes = NDArray[np.int64]
"""(6, N), rows: 1/65536 degree, 1/4 mm, quality, starts a revolution, number in the stream, bytes were lost before."""

_NONE = np.empty((6, 0), np.int64)

_LEGACY = np.dtype([("flags", "u1"), ("angle", "<u2"), ("distance", "<u2")])
_HQ = np.dtype(
    [
        ("header", "V9"),
        ("nodes", [("angle", "<u2"), ("distance", "<u4"), ("quality", "u1"), ("flags", "u1")], 96),
        ("crc", "V4"),
    ]
)


def _legacy(data: bytes) -> Nodes:
    nodes = np.frombuffer(data, _LEGACY).astype([(name, "i8") for name in _LEGACY.names or ()])
    blank = np.zeros(len(nodes), np.int64)
    angles = (nodes["angle"] >> 1 << 10) % TURN
    return np.stack([angles, nodes["distance"], nodes["flags"] >> 2, nodes["flags"] & 1, blank, blank])


def _hq(data: bytes) -> Nodes:
    """Angles in 1/16384 of a right angle."""
    nodes = np.frombuffer(data, _HQ)["nodes"].ravel()
    blank = np.zeros(len(nodes), np.int64)
    angles = nodes["angle"].astype(np.int64) * 360 % TURN
    return np.stack([angles, nodes["distance"], nodes["quality"], nodes["flags"] & 1, blank, blank])


DECODERS: dict[Answer, Callable[[bytes], Nodes]] = {Answer.NODES: _legacy, Answer.HQ: _hq}


class NodeSequence:
    """Takes packets of nodes, puts revolutions into `completed`; what comes before the first start is left out.

    The newest node waits for the next one, which shows whether its angle leaps; a few wait for more, to save time.
    """

    def __init__(self, answer: Answer, clock: SampleClock, counts: Counts) -> None:
        self._format, self._decode = FORMATS[answer], DECODERS[answer]
        self._clock, self._counts = clock, counts
        self.completed: list[Revolution] = []
        self._count = 0
        self._nodes = _NONE  # of the present turn; the newest `_waiting` of them may leap
        self._waiting = 0
        self._begun = self._at_front = False  # the present turn is to be given out; it began at the front

    def _forget(self) -> None:
        """Leave out what is there, and what comes before the next start."""
        self._counts.partial_samples += self._nodes.shape[1]
        self._nodes, self._waiting, self._begun, self._at_front = _NONE, 0, False, False

    def add(self, skipped: int, data: bytes, arrival: float, behind: int) -> None:
        """The next packets, how many bytes before them belonged to none, how many bytes were found behind them."""
        nodes = self._decode(data)
        lost = -(-skipped // self._format.size) * self._format.samples  # of one that lost bytes, less is left
        first = self._count + lost
        self._count = first + nodes.shape[1]
        nodes[INDEX] = np.arange(first, self._count)
        nodes[AFTER_LOSS, 0] = skipped > 0
        newest = self._count + behind // self._format.size * self._format.samples
        if lost > MOST_LOST or (self._leaps_to(nodes) and self._clock.late(newest, arrival) > LATE):
            self._cut(arrival)
        self._clock.arrived(newest, arrival)
        for start in range(0, nodes.shape[1], CHUNK):
            self._collect(nodes[:, start : start + CHUNK], arrival)

    def _leaps_to(self, nodes: Nodes) -> bool:
        """Something is missing before these nodes."""
        return bool((np.abs(_signed(nodes[ANGLE, :1] - self._nodes[ANGLE, -1:])) > GAP).any())

    def _cut(self, arrival: float) -> None:
        """Nobody knows how much was lost before the next node: it may be in any later turn."""
        self._examine(arrival)
        self._finish(self._nodes.shape[1], arrival)
        self._clock.reset()
        self._waiting, self._at_front = 0, False

    def _collect(self, nodes: Nodes, arrival: float) -> None:
        self._nodes = np.concatenate([self._nodes, nodes], 1)
        self._waiting += nodes.shape[1]
        if self._waiting >= FEW or self._nodes[START, -self._waiting : -1].any():
            self._examine(arrival)

    def _examine(self, arrival: float) -> None:
        """Do with the nodes that wait what is to be done."""
        self._leave_out_leaps()
        while (end := self._end_of_turn()) is not None:
            self._finish(end, arrival)
            self._begun = self._at_front = True
        if self._nodes.shape[1] > MOST_NODES:
            self._forget()

    def _leave_out_leaps(self) -> None:
        """Nodes far from both neighbours, while those are close to each other."""
        first = max(self._nodes.shape[1] - self._waiting - 1, 0)
        angles = self._nodes[ANGLE, first:]
        leaping = np.abs(_signed(np.diff(angles))) > LEAP
        across = np.abs(_signed(angles[2:] - angles[:-2])) <= LEAP
        leaps = np.flatnonzero(leaping[:-1] & leaping[1:] & across) + first + 1
        self._waiting = 1
        if len(leaps):
            self._counts.drop("unfit_packets", len(leaps))
            self._nodes = np.delete(self._nodes, leaps, 1)

    def _end_of_turn(self) -> int | None:
        """How many nodes the present turn has; None if it goes on."""
        nodes = self._nodes[:, : -self._waiting]
        if not nodes.shape[1]:
            return None
        turned = self._turned(nodes[ANGLE])
        starts = (nodes[START] > 0) & (np.abs(_signed(nodes[ANGLE])) < LEAP)
        if self._at_front:
            starts &= turned > TURN // 2
        ends = starts | (turned >= OVERDUE)
        first = int(np.argmax(ends))
        if not ends[first]:
            return None
        return first if starts[first] else int(np.argmax(turned >= TURN))

    def _turned(self, angles: Ints) -> Ints:
        """(N,) how far each node is from the front where the turn begins; nodes go back by less than LEAP."""
        steps = (np.diff(angles) + LEAP) % TURN - LEAP
        first = _signed(angles[:1]) if self._at_front else angles[:1]
        return np.cumsum(np.append(first, steps))

    def _finish(self, end: int, arrival: float) -> None:
        """The first nodes are a turn."""
        nodes, self._nodes = self._nodes[:, :end], self._nodes[:, end:]
        if not self._begun:
            self._counts.partial_samples += end
        elif end:
            nodes = self._sound(nodes)
            angles, distances, quality, _, indices, after_loss = nodes
            turned = self._turned(angles)
            gaps = _gaps(turned, after_loss > 0)
            if self._format.samples == 1:
                gaps = _joined(gaps, missing(turned))
            times = self._clock.times(indices)
            revolution = Revolution(angles, distances, times, quality.astype(np.uint8), gaps, arrival)
            self.completed.append(revolution)

    def _sound(self, nodes: Nodes) -> Nodes:
        """The nodes whose angle fits the spacing of the turn, if that is all there is to judge them by."""
        if self._format.samples > 1:
            return nodes
        # Where nothing returned, nothing is bent.
        wrong = misfits(self._turned(nodes[ANGLE])) & (nodes[DISTANCE] > 0)
        self._counts.drop("unfit_packets", int(wrong.sum()))
        return nodes[:, ~wrong]


def _signed(angles: Ints) -> Ints:
    """Angles from minus half a turn to half a turn."""
    return (angles + TURN // 2) % TURN - TURN // 2


def _joined(gaps: Ints, more: Ints) -> Ints:
    """Gaps of both, in order, without those that lie within one of the first."""
    new = [(begin, end) for begin, end in more if not ((gaps[:, 0] <= begin) & (end <= gaps[:, 1])).any()]
    joined = np.concatenate([gaps, np.array(new, np.int64).reshape(-1, 2)]).clip(0, TURN)
    return joined[np.argsort(joined[:, 0], kind="stable")]


def _gaps(turned: Ints, after_loss: Bools) -> Ints:
    """(G, 2) 1/65536 degree: where bytes were lost, or neighbours, or the turn's ends, are far apart."""
    edges = np.concatenate([[0], np.maximum.accumulate(turned), [TURN]]).clip(0, TURN)
    widths = np.diff(edges)
    lost = (widths > GAP) | (np.append(after_loss, False) & (widths > 0))
    return np.stack([edges[:-1][lost], edges[1:][lost]], -1)
