"""Streams of dense capsules whose every sample is known, made and read without the code under test.

Distances are numbers of samples, so that every sample that comes out says which one it is, and where it truly was.
"""

import struct
from dataclasses import dataclass
from functools import reduce
from operator import xor

import numpy as np

PERIOD = 108e-6  # s per sample
PER_CAPSULE = 40
LINE = 84 * 10 / 256000  # s that a capsule takes on the line
FARTHEST = 40_000  # mm; what an error of angle is weighed with


def capsule(start_q6: int, samples, restarted=False) -> bytes:
    body = struct.pack("<H", start_q6 | restarted << 15) + b"".join(struct.pack("<H", s) for s in samples)
    check = reduce(xor, body)
    return bytes((0xA0 | check & 15, 0x50 | check >> 4)) + body


@dataclass
class Stream:
    """capsules; when each has arrived (s); true angle (deg, growing) and time (s) of every sample, numbered from 0."""

    capsules: list[bytes]
    arrivals: np.ndarray
    angles: np.ndarray
    times: np.ndarray

    def __post_init__(self) -> None:
        self.data = b"".join(self.capsules)


def stream(count: int, rpm=lambda t: 600 + 0 * t, first_deg=350.0, period=PERIOD) -> Stream:
    """`count` capsules (at most 1638) of a sensor that turns as the function of time (s) says."""
    times = np.arange(count * PER_CAPSULE) * period
    angles = first_deg + np.concatenate([[0], np.cumsum(6 * rpm(times[:-1] + period / 2) * period)])
    starts = (angles[::PER_CAPSULE] * 64).astype(int) % (360 * 64)
    numbers = np.arange(1, len(times) + 1).reshape(count, PER_CAPSULE)
    capsules = [
        capsule(start, row, i == 0)
        for i, (start, row) in enumerate(zip(starts.tolist(), numbers.tolist(), strict=True))
    ]
    arrivals = times[PER_CAPSULE - 1 :: PER_CAPSULE] + 1.5 * PERIOD + LINE
    return Stream(capsules, arrivals, angles, times)


def numbers(revolution) -> np.ndarray:
    """Which samples of the stream a revolution holds."""
    assert not (revolution.distances % 4).any()
    return revolution.distances // 4 - 1


def decoded(decoder, source: Stream, capsules=None, arrivals=None):
    """Revolutions, each capsule fed when it has arrived; None stands for one that was lost."""
    fed = zip(
        source.capsules if capsules is None else capsules,
        source.arrivals if arrivals is None else arrivals,
        strict=True,
    )
    return [r for data, arrival in fed if data is not None for r in decoder.feed(data, arrival)]


def errors_mm(angles_q16, which, source: Stream) -> np.ndarray:
    """How far points at the farthest range are off, because of their angle."""
    away = (angles_q16 / 65536 - source.angles[which] + 180) % 360 - 180
    return np.abs(np.radians(away)) * FARTHEST


def z_q14(revolution) -> np.ndarray:
    """(N,) the angles as Slamtec's SDK gives them: 1/16384 of a right angle."""
    return ((revolution.angles >> 10) << 8) // 90


def slamtec_dense(capsules):
    """(angle in 1/65536 deg, z_q14, dist_q2) of each node as Slamtec's SDK 2.1 computes them, integer for integer."""
    nodes, previous = [], None
    for data in capsules:
        if previous is not None:
            before, after = ((struct.unpack("<H", d[2:4])[0] & 0x7FFF) << 2 for d in (previous, data))
            turned = after - before + (360 << 8 if before > after else 0)
            r, inc = before << 8, (turned << 8) // 40
            for (distance,) in struct.iter_unpack("<H", previous[4:]):
                q6 = r >> 10
                q6 -= 23040 if q6 >= 23040 else 0
                nodes.append((r % (360 << 16), (q6 << 8) // 90, distance << 2))
                r += inc
        previous = data
    return np.array(nodes)
