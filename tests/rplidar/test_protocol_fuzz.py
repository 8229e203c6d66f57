"""Ten million bytes of nonsense and half-sense: no exception, no unbounded memory, and what comes out is sound."""

import itertools
import struct
import tracemalloc
import zlib
from functools import reduce
from operator import xor

import numpy as np
import pytest

from lidarcore.rplidar.protocol import (
    Answer,
    Descriptor,
    DeviceInfo,
    Health,
    RequestReader,
    Revolution,
    StreamDecoder,
)

PACKETS = {0x81: 5, 0x82: 84, 0x83: 781, 0x84: 132, 0x85: 84}  # bytes, as Slamtec documents them
LONGEST_WAIT = 800  # bytes that a decoder may keep back
ALL = 10_000_000
SHARE = ALL // (3 * len(PACKETS))  # for each kind of nonsense and each answer type


def randomly(answer: int, dice: np.random.Generator) -> bytes:
    return dice.bytes(SHARE)


def with_headers_everywhere(answer: int, dice: np.random.Generator) -> bytes:
    return dice.choice([0xA5, 0x5A, 0x55, 0x01, 0x02, 0x00, 0xFF], SHARE).astype(np.uint8).tobytes()


def almost_rightly(answer: int, dice: np.random.Generator) -> bytes:
    """Packets that are right but for what they say, some of them cut, doubled, flipped, or with noise between."""
    made = [packet(answer, i, dice) for i in range(400)]
    sent, size = [], 0
    for i in itertools.count():
        data = made[i % len(made)] if dice.random() < 0.9 else made[dice.integers(len(made))]
        kind = dice.integers(0, 60)
        if kind == 0:
            data = data[: dice.integers(0, len(data))]
        elif kind == 1:
            data += dice.bytes(dice.integers(0, 2000))
        elif kind == 2:
            data = bytes((data[0] ^ 1 << dice.integers(8), *data[1:]))
        elif kind == 3:
            data *= dice.integers(0, 40)
        sent.append(data)
        size += len(data)
        if size >= SHARE:
            return b"".join(sent)[:SHARE]
    raise AssertionError


def packet(answer: int, i: int, dice: np.random.Generator) -> bytes:
    """With angles that go around, in steps that change now and then, and leap."""
    angle = (
        int(i * (900 + 40 * (i // 100)) + (dice.integers(0, 23040) if dice.random() < 0.05 else 0)) % 23040
    )
    if answer == 0x81:
        start = dice.random() < 0.02
        return struct.pack("<BHH", dice.integers(64) << 2 | 2 - start, angle << 1 | 1, dice.integers(65536))
    if answer == 0x83:
        body = b"\xa5" + dice.bytes(776)
        return body + struct.pack("<I", zlib.crc32(body + bytes(3)))
    body = struct.pack("<H", angle | (dice.random() < 0.002) << 15) + dice.bytes(PACKETS[answer] - 4)
    check = reduce(xor, body)
    return bytes((0xA0 | check & 15, 0x50 | check >> 4)) + body


def assert_sound(revolution: Revolution) -> None:
    turn = 360 << 16
    assert len(revolution) > 0
    assert ((revolution.angles >= 0) & (revolution.angles < turn)).all()
    assert (revolution.distances >= 0).all()
    assert np.isfinite(revolution.times).all()
    assert (np.diff(revolution.times) > 0).all()
    assert ((revolution.gaps >= 0) & (revolution.gaps <= turn)).all()
    assert (revolution.gaps[:, 0] < revolution.gaps[:, 1]).all()
    assert (revolution.gaps[:, 1] - revolution.gaps[:, 0]).sum() <= turn
    assert len(revolution.scan()) == len(revolution)


@pytest.mark.long
@pytest.mark.parametrize("nonsense", [randomly, with_headers_everywhere, almost_rightly])
@pytest.mark.parametrize("answer", PACKETS, ids=lambda answer: Answer(answer).name.lower())
def test_nonsense_is_survived_and_accounted_for(answer: int, nonsense) -> None:
    dice = np.random.default_rng(answer)
    data, decoder, at, now = nonsense(answer, dice), StreamDecoder(answer, 108.0), 0, 0.0
    while at < len(data):
        size = int(dice.choice([1, 7, 84, 500, 4096, 60_000], p=[0.1, 0.1, 0.2, 0.2, 0.2, 0.2]))
        now += size * 5e-5 * dice.choice([0, 1, 2]) + dice.choice([0, 2.0], p=[0.99, 0.01])
        for revolution in decoder.feed(data[at : at + size], now):
            assert_sound(revolution)
        at += size
    counts = decoder.statistics
    assert counts.bytes == len(data)
    used = counts.packets * PACKETS[answer] + counts.dropped["garbage_bytes"]
    assert 0 <= counts.bytes - used < LONGEST_WAIT
    if nonsense is almost_rightly:
        assert counts.revolutions > 0


def standing_still(answer: int, dice: np.random.Generator) -> bytes:
    """The same angle for ever, and none that starts a turn."""
    if answer == 0x81:
        return struct.pack("<BHH", 2, 5000 << 1 | 1, 1234) * 100_000
    body = struct.pack("<H", 5000) + bytes(PACKETS[answer] - 4)
    check = reduce(xor, body)
    return (bytes((0xA0 | check & 15, 0x50 | check >> 4)) + body) * 6000


def never_starting(answer: int, dice: np.random.Generator) -> bytes:
    """Angles go around, but the motor of a legacy sensor stands for a while, and then nodes start turns again."""
    if answer != 0x81:
        return creeping(answer, dice)
    stood = standing_still(answer, dice)[:200_000]
    turning = (
        struct.pack("<BHH", 1 if i % 400 == 0 else 2, i % 400 * 57 << 1 | 1, 99) for i in range(40_000)
    )
    return stood + b"".join(turning)


def creeping(answer: int, dice: np.random.Generator) -> bytes:
    """A turn that takes minutes."""
    if answer == 0x81:
        return b"".join(struct.pack("<BHH", 2, (5000 + i // 50) << 1 | 1, 1234) for i in range(100_000))
    made = []
    for i in range(6000):
        body = struct.pack("<H", (5000 + i) % 23040) + bytes(PACKETS[answer] - 4)
        check = reduce(xor, body)
        made.append(bytes((0xA0 | check & 15, 0x50 | check >> 4)) + body)
    return b"".join(made)


@pytest.mark.long
@pytest.mark.parametrize("nonsense", [randomly, almost_rightly, standing_still, creeping, never_starting])
@pytest.mark.parametrize("answer", [0x81, 0x85], ids=lambda answer: Answer(answer).name.lower())
@pytest.mark.parametrize("pause", [0.0, 1e9], ids=["", "after a leap of the clock"])
def test_memory_is_bounded(answer: int, nonsense, pause: float) -> None:
    data, decoder = nonsense(answer, np.random.default_rng(1)), StreamDecoder(answer, 108.0)
    half = len(data) // 2
    for revolution in decoder.feed(data[:half], 1.0):
        assert_sound(revolution)
    tracemalloc.start()
    for at in range(half, len(data), 4096):
        for revolution in decoder.feed(data[at : at + 4096], 1.0 + pause):
            assert_sound(revolution)
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert held < 1_000_000


def test_requests_and_answers_survive_nonsense() -> None:
    data = with_headers_everywhere(0, np.random.default_rng(8)) + randomly(0, np.random.default_rng(9))
    reader = RequestReader()
    used = sum(
        2 if request.command < 0x80 else 4 + len(request.payload)
        for at in range(0, len(data), 1000)
        for request in reader.feed(data[at : at + 1000])
    )
    assert 0 <= len(data) - used - reader.dropped <= 4 + 255
    for at in range(0, 100_000, 20):
        Descriptor.decode(data[at : at + 7])
        DeviceInfo.decode(data[at : at + 20]).name.encode()
        Health.decode(data[at : at + 3]).name.encode()
