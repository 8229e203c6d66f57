"""Dense capsules, as an S1 sends them, undamaged: every node, every turn, every time."""

import time

import capsule_streams as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarcore.rplidar.protocol import StreamDecoder

SPEEDS = {
    "600 rpm": lambda t: 600 + 0 * t,
    "480 rpm": lambda t: 480 + 0 * t,
    "900 rpm": lambda t: 900 + 0 * t,
    "spinning up within half a second": lambda t: np.minimum(480 + 840 * t, 900),
    "slowing down": lambda t: np.maximum(900 - 840 * t, 480),
    "wavering by 3 %": lambda t: 600 * (1 + 0.03 * np.sin(17 * t)),
}


def decoder() -> StreamDecoder:
    return StreamDecoder(0x85, 108.0)


@pytest.mark.parametrize("rpm", SPEEDS.values(), ids=SPEEDS.keys())
def test_every_node_is_that_of_slamtecs_decoder(rpm) -> None:
    source = cs.stream(1200, rpm)
    dec = decoder()
    revolutions = cs.decoded(dec, source)
    theirs = cs.slamtec_dense(source.capsules)
    front = int(np.flatnonzero(np.diff(theirs[:, 0]) < 0)[0]) + 1
    columns = [(r.angles, cs.z_q14(r), r.distances) for r in revolutions]
    ours = np.concatenate([np.stack(column, -1) for column in columns])
    np.testing.assert_array_equal(ours, theirs[front : front + len(ours)])
    assert len(revolutions) == int(source.angles[-41] // 360) - 1
    assert all(r.complete for r in revolutions)
    assert not dec.statistics.dropped
    assert dec.statistics.partial_samples == front


def test_the_golden_pair() -> None:
    first, second = cs.capsule(22400, range(1000, 1040), True), cs.capsule(352, [2000] * 40)
    later = [cs.capsule((22400 + 992 * i) % 23040, [3000] * 40) for i in range(2, 28)]
    revolution = decoder().feed(b"".join([first, second, *later]), 1.0)[0]
    assert first[:8].hex() == "a75580d7e803e903"
    assert (revolution.angles[0] >> 10, cs.z_q14(revolution)[0], revolution.distances[0]) == (4, 11, 1026 * 4)
    assert (revolution.angles[13] >> 10, cs.z_q14(revolution)[13], revolution.distances[13]) == (
        327,
        930,
        1039 * 4,
    )
    assert (revolution.angles[14] >> 10, revolution.distances[14]) == (352, 8000)


def test_one_turn_is_one_revolution() -> None:
    source = cs.stream(400)
    for revolution in cs.decoded(decoder(), source):
        assert np.ptp(source.angles[cs.numbers(revolution)]) < 360
        assert len(revolution) in (925, 926, 927)
        assert 0 <= revolution.angles[0] < revolution.angles[-1] < 360 << 16
        assert (np.diff(revolution.angles) > 0).all()


@given(st.data())
@settings(max_examples=60)
def test_fragments_of_any_size_give_the_same(data) -> None:
    source = cs.stream(130)
    damaged = bytearray(source.data)
    for at in data.draw(st.lists(st.integers(0, len(damaged) - 1), max_size=6)):
        damaged[at] ^= data.draw(st.integers(0, 255))
    sent = bytes(damaged)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(sent)), max_size=60)))
    whole, parts = decoder(), decoder()
    expected = whole.feed(sent, 1.0)
    pieces = [sent[a:b] for a, b in zip([0, *cuts], [*cuts, len(sent)], strict=True)]
    got = [revolution for piece in pieces for revolution in parts.feed(piece, 1.0)]
    assert parts.statistics == whole.statistics
    for ours, theirs in zip(got, expected, strict=True):
        np.testing.assert_array_equal(ours.angles, theirs.angles)
        np.testing.assert_array_equal(ours.distances, theirs.distances)
        np.testing.assert_array_equal(ours.gaps, theirs.gaps)


# How arrivals are delayed, and the error allowed: a millisecond, or 1 % of the time from one capsule to the
# next that is not delayed at all, which for the adapter is 50 capsules (50 x 4.32 ms = 13.5 x 16 ms).
DELAYS = {
    "a millisecond now and then": (lambda t, dice: t + dice.exponential(1e-3, len(t)), 1e-3),
    "an adapter that collects for 16 ms": (lambda t, dice: np.ceil(t / 16e-3) * 16e-3, 0.01 * 50 * 4.32e-3),
    "a computer that is away for 80 ms": (
        lambda t, dice: np.where((t % 1) < 0.08, t - t % 1 + 0.08, t),
        1e-3,
    ),
}


@pytest.mark.parametrize(("delayed", "allowed"), DELAYS.values(), ids=DELAYS.keys())
def test_times_are_those_of_measurement_whatever_the_delays(delayed, allowed: float) -> None:
    source = cs.stream(1500)
    arrivals = delayed(source.arrivals, np.random.default_rng(5))
    revolutions = cs.decoded(decoder(), source, arrivals=arrivals)[5:]
    errors = np.concatenate([r.times - source.times[cs.numbers(r)] for r in revolutions])
    assert np.abs(errors).max() < allowed
    assert all((np.diff(r.times) > 0).all() for r in revolutions)


def test_times_follow_a_sensor_that_is_slower_than_it_says() -> None:
    source = cs.stream(1500, period=1 / 9200)
    revolutions = cs.decoded(decoder(), source)
    errors = np.concatenate([r.times - source.times[cs.numbers(r)] for r in revolutions])
    assert np.abs(errors).max() < 1e-3


def test_a_scan_is_counter_clockwise_in_metres_and_radians() -> None:
    source = cs.stream(100)
    revolution = cs.decoded(decoder(), source)[0]
    scan = revolution.scan(stamp_offset=1000.0)
    which = (scan.ranges * 1000).round().astype(int) - 1
    np.testing.assert_array_equal(np.sort(which), cs.numbers(revolution))
    away = (np.degrees(scan.bearings) + source.angles[which] + 180) % 360 - 180
    assert np.abs(away).max() < 0.02
    assert scan.stamp == pytest.approx(1000 + source.times[which].min(), abs=1e-6)
    np.testing.assert_allclose(scan.stamp + scan.beam_times - 1000, source.times[which], atol=1e-6)
    assert scan.quality is None
    assert scan.completeness == 1


def test_no_return_is_missing() -> None:
    empty = b"".join(cs.capsule(992 * i % 23040, [0, 5] * 20) for i in range(60))
    scan = decoder().feed(empty, 1.0)[0].scan()
    assert np.isnan(scan.ranges).sum() == pytest.approx(len(scan) / 2, abs=1)


@pytest.mark.parametrize("size", [84, 100_000], ids=["capsule by capsule", "in bulk"])
def test_a_hundred_sensors_could_be_decoded_by_one_core(size: int) -> None:
    data = cs.stream(1600).data
    needed = []
    for _ in range(5):
        dec, begin = decoder(), time.thread_time()
        for at in range(0, len(data), size):
            dec.feed(data[at : at + size], at * 5e-5)
        needed.append(time.thread_time() - begin)
    assert 1600 * 40 * cs.PERIOD / min(needed) > 100
