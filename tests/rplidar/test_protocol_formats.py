"""Legacy nodes, express, ultra and HQ packets, read by decoders of their own."""

import struct
import zlib
from functools import reduce
from itertools import pairwise
from operator import xor

import numpy as np
import pytest
import rplidar
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarcore.rplidar.protocol import StreamDecoder, encode_nodes

US_PER_NODE = 244.0


def nodes(count: int, step: float = 0.8784, first: float = 357.0, seed: int = 3) -> tuple[bytes, np.ndarray]:
    """Legacy nodes of a steady sensor (600 rpm at 4098 nodes/s), and their true angles (deg, growing)."""
    dice = np.random.default_rng(seed)
    angles = first + step * np.arange(count)
    starts = np.diff(np.floor(angles / 360), prepend=np.floor(angles[0] / 360)) > 0
    distances = np.where(dice.random(count) < 0.1, 0, dice.integers(600, 65_000, count)) / 4
    return encode_nodes(angles % 360, distances, dice.integers(0, 64, count), starts), angles


def by_roboticia(data: bytes) -> list[tuple[bool, int, float, float]]:
    return [rplidar._process_scan(data[at : at + 5]) for at in range(0, len(data), 5)]


def test_legacy_nodes_are_those_of_another_decoder_turn_by_turn() -> None:
    data, _ = nodes(6000)
    decoder = StreamDecoder(0x81, US_PER_NODE)
    ours = decoder.feed(data, 1.0)
    theirs, turn = [], None
    for start, *measured in by_roboticia(data):
        if start:
            theirs.append(turn := [])
        if turn is not None:
            turn.append(measured)
    assert len(ours) == len(theirs) - 1 == 14
    for revolution, turn in zip(ours, theirs, strict=False):
        quality, angles, distances = np.array(turn).T
        np.testing.assert_array_equal(revolution.quality, quality)
        np.testing.assert_array_equal(revolution.angles / 65536, angles)
        np.testing.assert_array_equal(revolution.distances / 4, distances)
        assert revolution.complete
    assert not decoder.statistics.dropped


def test_a_scan_of_legacy_nodes_has_their_quality() -> None:
    revolution = StreamDecoder(0x81, US_PER_NODE).feed(nodes(1000)[0], 1.0)[0]
    scan = revolution.scan()
    np.testing.assert_array_equal(np.sort(scan.quality), np.sort(revolution.quality))


@given(st.data())
@settings(max_examples=40)
def test_legacy_fragments_of_any_size_give_the_same(data) -> None:
    sent = bytearray(nodes(1500)[0])
    for at in data.draw(st.lists(st.integers(0, len(sent) - 1), max_size=6)):
        sent[at] ^= data.draw(st.integers(0, 255))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(sent)), max_size=60)))
    whole, parts = StreamDecoder(0x81, US_PER_NODE), StreamDecoder(0x81, US_PER_NODE)
    expected = whole.feed(bytes(sent), 1.0)
    pieces = [bytes(sent[a:b]) for a, b in zip([0, *cuts], [*cuts, len(sent)], strict=True)]
    got = [revolution for piece in pieces for revolution in parts.feed(piece, 1.0)]
    for ours, theirs in zip(got, expected, strict=True):
        for column in ("angles", "distances", "quality", "gaps"):
            np.testing.assert_array_equal(getattr(ours, column), getattr(theirs, column))
    assert parts.statistics == whole.statistics


def test_legacy_times_are_those_of_measurement() -> None:
    data, angles = nodes(8000)
    decoder, dice = StreamDecoder(0x81, US_PER_NODE), np.random.default_rng(2)
    period = US_PER_NODE / 1e6
    revolutions = []
    for at in range(0, 8000, 16):
        sent = (at + 15) * period + 1.5 * period + 50 / 256000
        revolutions += decoder.feed(data[5 * at : 5 * at + 80], sent + dice.exponential(1e-3))
    for revolution in revolutions[3:]:
        which = np.searchsorted(
            angles, revolution.angles[0] / 65536 + 360 * np.floor(revolution.times[0] / 0.1 + 1) - 0.01
        )
        assert np.abs(revolution.times - period * (which + np.arange(len(revolution)))).max() < 1e-3


@pytest.mark.parametrize("seed", range(5))
def test_lost_bytes_merge_no_legacy_turns(seed: int) -> None:
    """Also where the node that starts a turn is among them."""
    dice = np.random.default_rng(seed)
    data, angles = nodes(20_000, seed=seed)
    starts = np.flatnonzero(np.diff(np.floor(angles / 360)) > 0) + 1
    hurt = np.union1d(dice.choice(20_000, 60, replace=False), starts[dice.random(len(starts)) < 0.5])
    sent = bytearray()
    for i in range(20_000):
        sent += data[5 * i : 5 * i + 5] if i not in hurt else data[5 * i : 5 * i + dice.integers(0, 5)]
    revolutions = StreamDecoder(0x81, US_PER_NODE).feed(bytes(sent), 1.0)
    assert len(revolutions) == len(starts) - 1
    for revolution in revolutions:
        turned = np.cumsum((np.diff(revolution.angles / 65536) + 180) % 360 - 180)
        assert 300 < turned[-1] < 362


def test_legacy_nodes_whose_angle_leaps_are_left_out() -> None:
    data, _ = nodes(3000)
    leaping = bytearray(data)
    for i in range(700, 2800, 100):
        leaping[5 * i + 2] ^= 0x40  # 128 degrees
    decoder = StreamDecoder(0x81, US_PER_NODE)
    revolutions = decoder.feed(bytes(leaping), 1.0)
    assert len(revolutions) == len(StreamDecoder(0x81, US_PER_NODE).feed(data, 1.0))
    assert decoder.statistics.dropped["unfit_packets"] == 21
    assert all((np.diff(r.angles) > 0).all() for r in revolutions)


@given(st.binary(max_size=4000))
@settings(max_examples=60)
def test_after_garbage_legacy_nodes_come_back(garbage: bytes) -> None:
    data, _ = nodes(2400)
    decoder = StreamDecoder(0x81, US_PER_NODE)
    decoder.feed(data[:4000], 1.0)
    decoder.feed(garbage, 1.0)
    last = decoder.feed(data[4000:], 1.0)[-1]
    expected = StreamDecoder(0x81, US_PER_NODE).feed(data, 1.0)[-1]
    np.testing.assert_array_equal(last.angles, expected.angles)
    np.testing.assert_array_equal(last.distances, expected.distances)


def capsule(start_q6: int, payload: bytes) -> bytes:
    body = struct.pack("<H", start_q6) + payload
    check = reduce(xor, body)
    return bytes((0xA0 | check & 15, 0x50 | check >> 4)) + body


def capsules(size: int, step_deg: float, count: int, seed: int = 1) -> list[bytes]:
    dice = np.random.default_rng(seed)
    return [capsule(int(64 * (350 + step_deg * i)) % 23040, dice.bytes(size - 4)) for i in range(count)]


def turned_q8(data: bytes, following: bytes) -> tuple[int, int]:
    start, end = ((struct.unpack("<H", d[2:4])[0] & 0x7FFF) << 2 for d in (data, following))
    return start, (end - start) % (360 << 8)


def slamtec_express(packets: list[bytes]) -> list[tuple[int, int]]:
    """(angle_q6, dist_q2) of every node, as Slamtec's SDK computes them."""
    found = []
    for data, following in pairwise(packets):
        start, turned = turned_q8(data, following)
        raw, inc = start << 8, turned << 3
        for at in range(4, 84, 5):
            first, second, lags = struct.unpack("<HHB", data[at : at + 5])
            for word, low in ((first, lags & 15), (second, lags >> 4)):
                angle = (raw - ((low | (word & 3) << 4) << 13)) >> 10
                found.append((angle % 23040, word & 0xFFFC))
                raw += inc
    return found


def unscaled(scaled: int) -> tuple[int, int]:
    for base, level, target in (
        (3328, 4, 1 << 14),
        (1792, 3, 1 << 12),
        (1280, 2, 1 << 11),
        (512, 1, 1 << 9),
        (0, 0, 0),
    ):
        if scaled >= base:
            return target + ((scaled - base) << level), level
    raise AssertionError


def slamtec_ultra(packets: list[bytes]) -> list[tuple[int, int]]:
    """The same for ultra capsules; a distance below zero, which no sensor sends, is none."""
    found = []
    for data, following in pairwise(packets):
        start, turned = turned_q8(data, following)
        raw, inc = start << 8, (turned << 3) // 3
        words = [word for (word,) in struct.iter_unpack("<I", data[4:])]
        nexts = [*words[1:], struct.unpack("<I", following[4:8])[0]]
        for word, next_word in zip(words, nexts, strict=True):
            (major, level), (next_major, next_level) = unscaled(word & 0xFFF), unscaled(next_word & 0xFFF)
            base, base_level = (next_major, next_level) if not major and next_major else (major, level)
            distances = [major << 2]
            for bits, near, shift in (
                (word >> 12 & 0x3FF, base, base_level),
                (word >> 22, next_major, next_level),
            ):
                signed = bits - 1024 if bits >= 512 else bits
                distances.append(0 if signed in (-512, 511) else max((signed * 2**shift + near) * 4, 0))
            for distance in distances:
                offset = int(7.5 * 3.1415926535 * (1 << 16) / 180.0)
                if distance >= 200:
                    k2 = 98361 // distance
                    offset = int(8 * 3.1415926535 * (1 << 16) / 180) - (k2 << 6) - (k2 * k2 * k2) // 98304
                angle = (raw - int(offset * 180 / 3.14159265)) >> 10
                found.append((angle % 23040, distance))
                raw += inc
    return found


@pytest.mark.parametrize(
    ("answer", "size", "samples", "theirs"),
    [(0x82, 84, 32, slamtec_express), (0x84, 132, 96, slamtec_ultra)],
    ids=["express", "ultra"],
)
def test_capsules_of_other_sensors_are_decoded_as_slamtec_does(
    answer: int, size: int, samples: int, theirs
) -> None:
    packets = capsules(size, 360 / 24.7, 200)
    decoder = StreamDecoder(answer, 250.0 if answer == 0x82 else 63.0)
    revolutions = decoder.feed(b"".join(packets), 1.0)
    ours = np.concatenate([np.stack([r.angles >> 10, r.distances], -1) for r in revolutions])
    first = decoder.statistics.partial_samples
    np.testing.assert_array_equal(ours, theirs(packets)[first : first + len(ours)])
    assert len(revolutions) == 8
    assert all(r.complete for r in revolutions)


def test_a_lost_ultra_capsule_takes_with_it_what_is_told_relative_to_it() -> None:
    packets = capsules(132, 360 / 24.7, 200)
    whole = StreamDecoder(0x84, 63.0).feed(b"".join(packets), 1.0)
    lossy = StreamDecoder(0x84, 63.0).feed(b"".join(packets[:40] + packets[41:]), 1.0)
    assert [len(r.gaps) for r in lossy] == [0, 1, 0, 0, 0, 0, 0, 0]
    before = np.searchsorted(lossy[1].angles, lossy[1].gaps[0, 0] - (2 << 16))
    np.testing.assert_array_equal(lossy[1].distances[: before - 96], whole[1].distances[: before - 96])


def hq(angles: np.ndarray, distances: np.ndarray, quality: np.ndarray, flags: np.ndarray) -> bytes:
    body = b"\xa5" + struct.pack("<Q", 12345)
    for node in zip(angles.tolist(), distances.tolist(), quality.tolist(), flags.tolist(), strict=True):
        body += struct.pack("<HIBB", *node)
    return body + struct.pack("<I", zlib.crc32(body + bytes(3)))


def test_hq_packets_are_checked_and_read() -> None:
    dice = np.random.default_rng(4)
    z = (np.arange(96 * 60) * 40 + 65_000) % 65536
    start = np.diff(z, prepend=z[0]) < 0
    distances, quality = dice.integers(0, 160_000, len(z)), dice.integers(0, 256, len(z))
    flags = np.where(start, 1, 2)
    packets = [hq(*(c[i : i + 96] for c in (z, distances, quality, flags))) for i in range(0, len(z), 96)]
    decoder = StreamDecoder(0x83, 62.5)
    revolutions = decoder.feed(b"".join(packets), 1.0)
    first = int(np.flatnonzero(start)[0])
    which = slice(first, first + sum(map(len, revolutions)))
    np.testing.assert_array_equal(np.concatenate([r.angles for r in revolutions]), z[which] * 360)
    np.testing.assert_array_equal(np.concatenate([r.distances for r in revolutions]), distances[which])
    np.testing.assert_array_equal(np.concatenate([r.quality for r in revolutions]), quality[which])
    assert len(revolutions) == start.sum() - 1
    damaged = bytearray(packets[20])
    damaged[300] ^= 4
    decoder = StreamDecoder(0x83, 62.5)
    revolutions = decoder.feed(b"".join([*packets[:20], bytes(damaged), *packets[21:]]), 1.0)
    assert decoder.statistics.dropped["damaged_packets"] == 1
    assert [r.complete for r in revolutions].count(False) == 1


@pytest.mark.parametrize(("kind", "us"), [(0x86, 31.25), (0x04, 108.0), (0x85, 0.0), (0x85, float("nan"))])
def test_what_is_no_scan_is_refused(kind: int, us: float) -> None:
    with pytest.raises(ValueError, match=r"is not a scan|give positive"):
        StreamDecoder(kind, us)
