"""Scans of every kind a recorder may meet, and the bytes of a sensor."""

import numpy as np

from lidarcore import Scan
from lidarcore.rplidar.protocol import encode_dense
from lidarcore.simulation import SimulatedSensor, furnished_room

UNIX = 1_795_000_000.0  # s, in 2026


def demo(count: int, start: float = UNIX) -> list[Scan]:
    """Scans of a simulated room, ten a second from `start` on, with quality, times and missing returns."""
    sensor, rng, pose = (
        SimulatedSensor(furnished_room(), max_range=5.0),
        np.random.default_rng(0),
        np.array([4.5, 4, 0]),
    )
    return [sensor.scan(pose, rng, start + 0.1 * k)[0] for k in range(count)]


def clockwise(gaps: tuple[tuple[int, int], ...] = (), beams: int = 926, stamp: float = UNIX) -> Scan:
    """As an RPLIDAR S1 measures: clockwise from its front in 0.1 s, without the beams from..to of each gap."""
    index = np.arange(beams)
    angles = 2 * np.pi * index / beams
    lost = np.zeros(beams, bool)
    for first, last in gaps:
        lost[first:last] = True
    sectors = [(-angles[last % beams], -angles[first - 1]) for first, last in gaps]
    ranges = np.where(index % 7 == 3, np.nan, 2 + np.sin(3 * angles))
    there = ~lost[::-1]
    return Scan(
        ranges[::-1][there],
        -angles[::-1][there],
        stamp,
        np.full(beams, 188.0)[there],
        (108e-6 * index)[::-1][there],
        gaps=np.array(sectors).reshape(-1, 2),
    )


def half_view(**fields) -> Scan:
    """A SICK: 180 degrees, one beam each, no times."""
    bearings = np.radians(np.arange(-90, 91))
    return Scan(np.linspace(1, 30, 181), bearings, UNIX, **fields)


KINDS = {
    "simulated": demo(1)[0],
    "clockwise": clockwise(),
    "with gaps": clockwise(((40, 80), (400, 520))),
    "with a gap at its seam": clockwise(((886, 926),)),
    "half of the view": half_view(),
    "with odometry": half_view(odometry=[1.5, -2.25, 3.0]),
    "one beam": Scan([2.5], [0.3], UNIX),
    "two beams of one bearing": Scan([2.5, 2.75], [0.3, 0.3], UNIX),
    "nothing seen": Scan(np.full(360, np.nan), np.radians(np.arange(360)), UNIX),
    "beyond the limits of an S1": Scan([0.01, 40.0, 250.0], [0.0, 0.1, 0.2], UNIX),
    "unknown times": Scan([1.0, 2.0], [0.1, 0.2], UNIX, beam_times=[np.nan, np.nan]),
    "before 1970": Scan([1.0, 2.0], [0.1, 0.2], -2.5),
}


def dense_stream(turns: int = 5, first: int = 0):
    """Capsules of an S1 that turns ten times a second from 350 degrees on, and their times of arrival in s."""
    width = 360 * 40 * 108e-6 * 10
    for k in range(int(turns * 360 / width)):
        distances = 1000 + 100 * first + (np.arange(40) + 40 * k) % 900
        yield encode_dense((350 + k * width) % 360, distances, k == 0), 0.00432 * (k + 1)


def assert_same(read: Scan, written: Scan) -> None:
    """Ranges, quality and times are stored in 32 bits, bearings, gaps and poses in 64."""
    np.testing.assert_array_equal(read.bearings, written.bearings)
    np.testing.assert_array_equal(read.ranges, single(written.ranges))
    np.testing.assert_array_equal(read.gaps, written.gaps)
    assert read.stamp == written.stamp
    for got, expected in ((read.quality, written.quality), (read.beam_times, written.beam_times)):
        assert (got is None) == (expected is None)
        if got is not None:
            np.testing.assert_array_equal(got, single(expected))
    assert (read.odometry is None) == (written.odometry is None)
    if read.odometry is not None:
        np.testing.assert_allclose(read.odometry, written.odometry, atol=1e-12)


def single(values):
    """Values as 32 bits hold them."""
    return np.asarray(values, np.float32).astype(float)
