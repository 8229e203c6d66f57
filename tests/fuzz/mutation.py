"""Broken bytes made of sound ones."""

import random
import re
from collections.abc import Callable

_NUMBER = re.compile(rb"\d+")
_ODD = (b"0", b"-1", b"1e308", b"nan", b"99999999999999999999", b"4294967295", b"0.0000001", b"")
_EXTREME = (b"\x00", b"\xff", b"\x7f", b"\x80")


def mutated(sound: bytes, rng: random.Random) -> bytes:
    """One to four changes at random."""
    for _ in range(rng.randint(1, 4)):
        sound = rng.choice(_CHANGES)(sound, rng)
    return sound


def _flipped(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 4, 30)) if data else 0):
        changed[_place(data, rng)] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _overwritten(data: bytes, rng: random.Random) -> bytes:
    at, size = rng.randrange(len(data) + 1), rng.choice((1, 2, 4, 8, 64))
    return data[:at] + rng.choice(_EXTREME) * size + data[at + size :]


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def _without(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + data[at + rng.choice((1, 4, 100)) :]


def _repeated(data: bytes, rng: random.Random) -> bytes:
    at, size = rng.randrange(len(data) + 1), rng.choice((1, 4, 100, 5000))
    return data[:at] + data[at : at + size] * rng.choice((2, 20)) + data[at:]


def _renumbered(data: bytes, rng: random.Random) -> bytes:
    """Another number in the place of one, where the data are text."""
    begin = _place(data, rng)
    found = _NUMBER.search(data, begin, begin + 1000)
    return data[: found.start()] + rng.choice(_ODD) + data[found.end() :] if found else data


def _place(data: bytes, rng: random.Random) -> int:
    """Often near the beginning, where headers are."""
    return rng.randrange(min(len(data), rng.choice((64, 1000, len(data)))) or 1)


_CHANGES: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    _flipped, _flipped, _overwritten, _cut, _without, _repeated, _renumbered,
)  # fmt: skip
