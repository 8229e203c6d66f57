"""Whatever is lost, damaged or late: each sample keeps the time it was measured at, each turn comes out once."""

import capsule_streams as cs
import numpy as np
import pytest

from lidarcore.rplidar.protocol import StreamDecoder

WHOLE = [60 / (n * 4.32e-3) for n in (16, 23, 28)]  # rpm at which a turn is a whole number of capsules
Fed = list[tuple[bytes, float]]


def decoder() -> StreamDecoder:
    return StreamDecoder(0x85, 108.0)


def wavering(t):
    return 600 * (1 + 0.03 * np.sin(11 * t))


def fed(dec: StreamDecoder, pieces: Fed):
    return [r for data, arrival in pieces for r in dec.feed(data, arrival)]


def turn_of(revolution, source: cs.Stream) -> int:
    return round((source.angles[cs.numbers(revolution)[0]] - revolution.angles[0] / 65536) / 360)


def worst_time(revolutions, source: cs.Stream) -> float:
    return max(float(np.abs(r.times - source.times[cs.numbers(r)]).max()) for r in revolutions)


def turns_with_a_run(source: cs.Stream, sent, least: int = 4) -> set[int]:
    """Turns in which so many undamaged capsules in a row lie; in these alone may nobody fail to see something."""
    turn = ((source.angles[::40] + 0.02) // 360).astype(int)
    good = np.array([data == whole for data, whole in zip(sent, source.capsules, strict=True)])
    runs = np.lib.stride_tricks.sliding_window_view(good, least).all(-1)
    whole = turn[: len(runs)] == turn[least - 1 :]
    return set(turn[: len(runs)][runs & whole].tolist())


def assert_each_turn_comes_once(revolutions, source: cs.Stream, sent) -> None:
    turns = [turn_of(r, source) for r in revolutions]
    assert turns == sorted(set(turns))
    expected = {turn for turn in turns_with_a_run(source, sent) if 1 < turn < source.angles[-1] // 360 - 1}
    assert expected <= set(turns)
    assert all(np.ptp(source.angles[cs.numbers(r)]) < 360 + 1 / 32 for r in revolutions)


@pytest.mark.long
@pytest.mark.parametrize("rpm", [480, 540, 600, 700, 900, *WHOLE])
def test_times_are_right_however_many_capsules_are_lost_in_a_row(rpm: float) -> None:
    """Nearly whole turns, too, where the next angle is closer than any loss of a few would make it."""
    source = cs.stream(450, lambda t: rpm + 0 * t)
    for lost in range(1, 241):
        sent = [None if 130 <= i < 130 + lost else data for i, data in enumerate(source.capsules)]
        dec = decoder()
        revolutions = cs.decoded(dec, source, sent)
        assert worst_time(revolutions, source) < 2e-3, lost
        assert_each_turn_comes_once(revolutions, source, sent)
        assert dec.statistics.dropped["missing_packets"] == pytest.approx(lost, abs=1)


def without_a_byte(data: bytes, dice: np.random.Generator) -> bytes:
    at = dice.integers(84)
    return data[:at] + data[at + 1 :]


def without_a_part(data: bytes, dice: np.random.Generator) -> bytes:
    first, last = sorted(dice.integers(0, 85, 2))
    return data[:first] + data[last:]


def with_more(data: bytes, dice: np.random.Generator) -> bytes:
    at = dice.integers(84)
    return data[:at] + dice.bytes(dice.integers(1, 40)) + data[at:]


def flipped(data: bytes, dice: np.random.Generator) -> bytes:
    damaged = bytearray(data)
    damaged[dice.integers(84)] ^= 1 << dice.integers(8)
    return bytes(damaged)


DAMAGES = [without_a_byte, without_a_part, with_more, flipped]


@pytest.mark.parametrize("share", [0.001, 0.005, 0.01, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("damage", DAMAGES)
def test_times_are_right_where_capsules_are_damaged(damage, share: float) -> None:
    for seed in range(3):
        dice = np.random.default_rng(seed)
        source = cs.stream(1600, wavering)
        sent = [damage(data, dice) if dice.random() < share else data for data in source.capsules]
        dec = decoder()
        revolutions = cs.decoded(dec, source, sent)
        assert worst_time(revolutions, source) < 1e-3
        assert_each_turn_comes_once(revolutions, source, sent)
        hurt = sum(ours != theirs for ours, theirs in zip(sent, source.capsules, strict=True))
        assert dec.statistics.dropped["missing_packets"] == pytest.approx(hurt, abs=3 + 0.1 * hurt)


def disturbed(source: cs.Stream, dice: np.random.Generator):
    """What is sent, and when it is read: damaged in all ways, lost singly and for up to a second; a reader that is
    away for up to 0.3 s, a millisecond of jitter."""
    sent: list[bytes | None] = list(source.capsules)
    for i, data in enumerate(source.capsules):
        if dice.random() < 0.03:
            sent[i] = DAMAGES[dice.integers(4)](data, dice)
        elif dice.random() < 0.01:
            sent[i] = None
    arrivals = source.arrivals + dice.exponential(3e-4, len(sent))
    for begin in (200, 600, 1000, 1350):
        lost = dice.integers(1, 240)
        sent[begin : begin + lost] = [None] * lost
    for begin in (500, 900, 1270):
        until = source.arrivals[begin] + dice.uniform(0.02, 0.3)
        away = (source.arrivals > source.arrivals[begin]) & (source.arrivals < until)
        arrivals[away] = until
    return sent, np.maximum.accumulate(arrivals)


def as_read(sent, arrivals) -> Fed:
    """What arrives at once is read at once."""
    read: dict[float, bytes] = {}
    for data, arrival in zip(sent, arrivals.tolist(), strict=True):
        read[arrival] = read.get(arrival, b"") + (data or b"")
    return [(data, arrival) for arrival, data in read.items() if data]


@pytest.mark.parametrize("rpm", [480, 600, 720, 900])
def test_times_are_right_under_all_that_may_happen_together(rpm: float) -> None:
    for seed in range(8):
        dice = np.random.default_rng(seed)
        source = cs.stream(1630, lambda t: rpm * (1 + 0.01 * np.sin(11 * t)))
        sent, arrivals = disturbed(source, dice)
        revolutions = fed(decoder(), as_read(sent, arrivals))
        assert worst_time(revolutions, source) < 5e-3, seed
        assert_each_turn_comes_once(revolutions, source, sent)
