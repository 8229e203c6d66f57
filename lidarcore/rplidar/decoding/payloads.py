"""What is in capsules: distances, and how far each sample lags behind its place between two capsules.

Bit for bit as Slamtec's SDK computes them, for P capsules at once.
"""

from collections.abc import Callable

import numpy as np

from lidarcore.arrays import Ints
from lidarcore.rplidar.answers import Answer

Samples = tuple[Ints, Ints]
"""Distances (P, n) in 1/4 mm, 0: no return; lags in 1/65536 degree, (P, n) or one for all."""

Decoder = Callable[[list[bytes], list[bytes | None]], Samples]
"""Decodes capsules, given for each the one that follows it, if that is known."""

_HEADER = [("header", "V4")]  # sync and checksum, start angle
_DENSE = np.dtype([*_HEADER, ("distances", "<u2", 40)])
_EXPRESS = np.dtype([*_HEADER, ("cabins", [("pair", "<u2", 2), ("lags", "u1")], 16)])
_ULTRA = np.dtype([*_HEADER, ("cabins", "<u4", 32)])


def _dense(capsules: list[bytes], following: list[bytes | None]) -> Samples:
    """40 distances in whole mm."""
    distances = np.frombuffer(b"".join(capsules), _DENSE)["distances"]
    return distances.astype(np.int64) << 2, np.zeros(1, np.int64)


def _express(capsules: list[bytes], following: list[bytes | None]) -> Samples:
    """16 cabins of two distances and lags; a lag (1/8 degree) has two bits beside its distance, four in a byte."""
    cabins = np.frombuffer(b"".join(capsules), _EXPRESS)["cabins"]
    pairs, halves = cabins["pair"].astype(np.int64), cabins["lags"].astype(np.int64)
    lags = np.stack([halves & 15, halves >> 4], -1) | (pairs & 3) << 4
    return (pairs & ~3).reshape(len(cabins), -1), (lags << 13).reshape(len(cabins), -1)


def _ultra(capsules: list[bytes], following: list[bytes | None]) -> Samples:
    """32 cabins of three distances: one as such, two as differences to it and to that of the next cabin."""
    words = np.frombuffer(b"".join(capsules), _ULTRA)["cabins"].astype(np.int64)
    after = [int.from_bytes(capsule[4:8], "little") if capsule else 0 for capsule in following]
    scaled = np.column_stack([words, after]) & 0xFFF
    major, shift = _VALUES[scaled], _SHIFTS[scaled]
    here, there = (major[:, :-1], shift[:, :-1]), (major[:, 1:], shift[:, 1:])
    nearest = np.where((here[0] == 0) & (there[0] != 0), there, here)
    second = _predicted(words >> 12 & 0x3FF, *nearest)
    third = _predicted(words >> 22, *there)
    third[[capsule is None for capsule in following], -1] = 0  # what it differs from was lost
    distances = np.stack([here[0] << 2, second, third], -1).reshape(len(words), -1)
    return distances, _ultra_lags(distances)


def _predicted(bits: Ints, base: Ints, shift: Ints) -> Ints:
    """Distance from a difference of 10 bits in two's complement, whose extremes mean no return."""
    difference = (bits ^ 0x200) - 0x200
    known = (difference != -512) & (difference != 511)
    return np.where(known, np.maximum((difference << shift) + base << 2, 0), 0)


def _ultra_lags(distances: Ints) -> Ints:
    """The angle between laser and receiver, by the distance: Slamtec's formula for the A series."""
    near = 98361 // np.maximum(distances, 200)
    lags = np.where(distances >= 200, 9150 - (near << 6) - near**3 // 98304, 8578)  # 1/65536 rad
    return np.trunc(lags * 180 / 3.14159265).astype(np.int64)


def _unscaled() -> tuple[Ints, Ints]:
    """For each of the 12-bit numbers its value and the shift that its differences have: coarser where larger."""
    scaled = np.arange(4096)
    level = np.searchsorted([512, 1280, 1792, 3328], scaled, side="right")
    first, value = np.array([0, 512, 1280, 1792, 3328]), np.array([0, 1 << 9, 1 << 11, 1 << 12, 1 << 14])
    return value[level] + (scaled - first[level] << level), level


_VALUES, _SHIFTS = _unscaled()

DECODERS: dict[Answer, Decoder] = {Answer.DENSE: _dense, Answer.EXPRESS: _express, Answer.ULTRA: _ultra}
