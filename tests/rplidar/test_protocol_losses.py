"""Capsules lost, damaged, or buried in garbage: nothing is smeared, no turns are merged, and it goes on at once."""

import capsule_streams as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarcore.rplidar.protocol import StreamDecoder

STEP = 360 * 10 * 40 * cs.PERIOD  # degrees from one capsule to the next at 600 rpm


def decoder() -> StreamDecoder:
    return StreamDecoder(0x85, 108.0)


def wavering(t):
    return 600 * (1 + 0.03 * np.sin(11 * t))


def assert_no_turns_are_merged(revolutions, source: cs.Stream) -> None:
    """Start angles are whole 1/64 degrees, so that a sample beside the front may be counted to the other side."""
    for revolution in revolutions:
        assert np.ptp(source.angles[cs.numbers(revolution)]) < 360 + 1 / 32


def assert_gaps_say_what_is_missing(revolutions, source: cs.Stream) -> None:
    """A sample of a turn is there, or its angle is in a gap; all but the first and the last turn."""
    there = np.zeros(len(source.angles), bool)
    for revolution in revolutions:
        which = cs.numbers(revolution)
        there[which] = True
        turn = np.floor((source.angles[which[len(which) // 2]] + 0.02) / 360) * 360
        inside = np.flatnonzero((source.angles >= turn + 0.02) & (source.angles < turn + 359.98))
        missing = np.setdiff1d(inside, which)
        angles = source.angles[missing] - turn
        in_gap = [(from_ - 0.05 <= angles) & (angles <= to + 0.05) for from_, to in revolution.gaps / 65536]
        assert np.any(in_gap, axis=0).all() if len(missing) else True
        lost = (revolution.gaps[:, 1] - revolution.gaps[:, 0]).sum() / 65536 / 0.3888
        assert lost == pytest.approx(len(missing), abs=0.04 * len(missing) + 2 * len(revolution.gaps) + 1)


@pytest.mark.parametrize("share", [0.01, 0.05, 0.2, 0.4])
@pytest.mark.parametrize("seed", range(3))
def test_where_capsules_are_lost_no_point_is_off(share: float, seed: int) -> None:
    source = cs.stream(1600, wavering)
    lost = np.random.default_rng(seed).random(1600) < share
    kept = [None if gone else data for data, gone in zip(source.capsules, lost, strict=True)]
    dec = decoder()
    revolutions = cs.decoded(dec, source, kept)
    errors = np.concatenate([cs.errors_mm(r.angles, cs.numbers(r), source) for r in revolutions])
    assert errors.max() < 60
    assert_no_turns_are_merged(revolutions, source)
    if share <= 0.05:
        assert len(errors) > 0.97 * (1 - share) * 0.98 * 64000
        assert_gaps_say_what_is_missing(revolutions, source)
        assert dec.statistics.dropped["missing_packets"] == pytest.approx(lost.sum(), abs=3)


def test_slamtecs_decoder_smears_points_where_capsules_are_lost() -> None:
    """That the test above can fail."""
    source = cs.stream(1600, wavering)
    kept = [
        d
        for d, gone in zip(source.capsules, np.random.default_rng(0).random(1600) < 0.05, strict=True)
        if not gone
    ]
    theirs = cs.slamtec_dense(kept)
    errors = cs.errors_mm(theirs[:, 0], theirs[:, 2] // 4 - 1, source)
    assert (errors > 60).mean() > 0.03


@pytest.mark.parametrize("share", [0.02, 0.2])
@pytest.mark.parametrize("seed", range(3))
def test_bit_flips_merge_no_turns_and_move_no_point(share: float, seed: int) -> None:
    """One or three bits: an odd number never escapes the checksum."""
    dice = np.random.default_rng(seed)
    source = cs.stream(1600, wavering)
    sent = [flipped(data, dice) if dice.random() < share else data for data in source.capsules]
    dec = decoder()
    revolutions = cs.decoded(dec, source, sent)
    assert_no_turns_are_merged(revolutions, source)
    assert np.concatenate([cs.errors_mm(r.angles, cs.numbers(r), source) for r in revolutions]).max() < 60
    turns = [round(float(source.angles[cs.numbers(r)].mean() // 360)) for r in revolutions]
    if share < 0.1:
        assert turns == list(range(1, len(turns) + 1)), "every turn comes out once"
        assert len(turns) >= 67
    assert dec.statistics.dropped["damaged_packets"] > 0


def flipped(data: bytes, dice: np.random.Generator) -> bytes:
    damaged = bytearray(data)
    for bit in dice.choice(84 * 8, dice.choice([1, 3]), replace=False):
        damaged[bit // 8] ^= 1 << bit % 8
    return bytes(damaged)


@pytest.mark.parametrize("seed", range(10))
def test_lost_bytes_cost_the_capsules_they_were_in_and_those_before(seed: int) -> None:
    """Two halves of capsules pass the checksum once in 256 times: no point may come of that."""
    dice = np.random.default_rng(seed)
    source = cs.stream(1600)
    lossy = [data[: dice.integers(0, 84)] if dice.random() < 0.05 else data for data in source.capsules]
    hurt = sum(len(data) < 84 for data in lossy)
    revolutions = cs.decoded(decoder(), source, lossy)
    which = np.concatenate([cs.numbers(r) for r in revolutions])
    assert np.concatenate([cs.errors_mm(r.angles, cs.numbers(r), source) for r in revolutions]).max() < 60
    assert_no_turns_are_merged(revolutions, source)
    assert hurt > 50
    assert len(which) > 40 * (1600 - 27 - 24 - 3.2 * hurt)


@given(st.integers(0, 30_000), st.integers(60, 110), st.integers(0, 2**32 - 1), st.booleans())
@settings(max_examples=150)
def test_after_garbage_of_any_length_it_is_back_within_two_capsules(
    length: int, at: int, seed: int, headers: bool
) -> None:
    source = cs.stream(200)
    dice = np.random.default_rng(seed)
    garbage = (
        dice.bytes(length)
        if not headers
        else dice.choice([0xA5, 0x5A, 0x55], length).astype(np.uint8).tobytes()
    )
    dec = decoder()
    revolutions = dec.feed(b"".join(source.capsules[:at]), 1.0)
    revolutions += dec.feed(garbage, 1.0)
    revolutions += dec.feed(b"".join(source.capsules[at:]), 1.0)
    which = [n for r in revolutions for n in (r.distances // 4 - 1).tolist()]
    last = (200 - 30) * 40
    assert set(range(30 * 40, (at - 2) * 40)) <= set(which)
    assert set(range((at + 2) * 40, last)) <= set(which)
    assert dec.statistics.dropped["garbage_bytes"] <= length + 84


def test_a_damaged_capsule_at_the_front_does_not_merge_turns() -> None:
    source = cs.stream(300)
    at_front = np.flatnonzero(np.diff(source.angles[::40] // 360) > 0)
    sent = [bytes(84) if i in at_front else data for i, data in enumerate(source.capsules)]
    revolutions = cs.decoded(decoder(), source, sent)
    assert len(revolutions) >= 10
    assert_no_turns_are_merged(revolutions, source)
    assert_gaps_say_what_is_missing(revolutions, source)
    assert not any(r.complete for r in revolutions)


@pytest.mark.long
@pytest.mark.parametrize("rpm", [480, 600, 900, *(60 / (n * 4.32e-3) for n in (16, 19, 24, 28))])
def test_lost_turns_are_not_made_up_of_their_neighbours(rpm: float) -> None:
    """Where a turn is a whole number of capsules, the angle does not tell that they are lost: the time does."""
    source = cs.stream(250, lambda t: rpm + 0 * t)
    for lost in range(1, 70):
        kept = [None if 100 <= i < 100 + lost else data for i, data in enumerate(source.capsules)]
        revolutions = cs.decoded(decoder(), source, kept)
        assert_no_turns_are_merged(revolutions, source)
        assert np.concatenate([cs.errors_mm(r.angles, cs.numbers(r), source) for r in revolutions]).max() < 60


def test_an_overrun_of_the_buffer_while_the_reader_was_away_merges_no_turns() -> None:
    """What had arrived is read at once, then capsules are missing, then it goes on as ever."""
    source = cs.stream(900)
    arrivals = np.where((source.arrivals > 1) & (source.arrivals < 2.4), 2.4, source.arrivals)
    overrun = (source.arrivals > 2.06) & (source.arrivals < 2.4)
    kept = [None if gone else data for data, gone in zip(source.capsules, overrun, strict=True)]
    revolutions = cs.decoded(decoder(), source, kept, arrivals)
    assert_no_turns_are_merged(revolutions, source)
    errors = np.concatenate([r.times - source.times[cs.numbers(r)] for r in revolutions if r.arrival > 2.6])
    assert np.abs(errors).max() < 2e-3


def test_a_reader_that_was_away_loses_nothing_if_the_buffer_held() -> None:
    source = cs.stream(900)
    arrivals = np.where((source.arrivals > 1) & (source.arrivals < 1.7), 1.7, source.arrivals)
    dec = decoder()
    away = np.flatnonzero(arrivals == 1.7)
    revolutions = []
    for i, data in enumerate(source.capsules):
        if i == away[0]:
            revolutions += dec.feed(b"".join(source.capsules[away[0] : away[-1] + 1]), 1.7)
        elif i not in away:
            revolutions += dec.feed(data, arrivals[i])
    assert all(r.complete for r in revolutions)
    which = np.concatenate([cs.numbers(r) for r in revolutions])
    assert (np.diff(which) == 1).all()


def test_a_restart_that_the_sensor_announces_begins_anew() -> None:
    source, again = cs.stream(150), cs.stream(150, first_deg=200.0)
    revolutions = decoder().feed(source.data + again.data, 1.0)
    assert all(r.complete for r in revolutions)


def test_a_sensor_whose_angle_stands_still_gives_nothing_and_holds_nothing() -> None:
    dec = decoder()
    assert dec.feed(b"".join(cs.capsule(1000, [9] * 40) for _ in range(3000)), 1.0) == []
    assert dec.statistics.dropped["unfit_packets"] > 2900


def test_the_speed_may_change_while_it_is_away() -> None:
    slow, fast = cs.stream(150), cs.stream(150, lambda t: 900 + 0 * t, first_deg=10.0)
    again = [
        cs.capsule(int(fast.angles[40 * i] * 64) % 23040, range(40 * i + 1, 40 * i + 41)) for i in range(150)
    ]
    dec = decoder()
    cs.decoded(dec, slow)
    revolutions = [r for i, data in enumerate(again) for r in dec.feed(data, 9 + i * 4.32e-3)][1:]
    assert len(revolutions) >= 7
    for revolution in revolutions:
        assert cs.errors_mm(revolution.angles, cs.numbers(revolution), fast).max() < 60
