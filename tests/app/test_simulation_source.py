"""A simulated robot as a source: real time, real threads."""

import time
from itertools import islice, pairwise

import lidarcore_app.sources.history
import numpy as np
import pytest
from lidarcore_app.sources.simulated import SimulationSource
from waiting import wait_until

from lidarcore import Scan
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

SETTINGS = SimulationSettings(world="corridor", field_of_view=np.pi, seed=4)


def played(source: SimulationSource, scans: int) -> list[float]:
    """When each scan arrived, until there were so many; the source is closed then."""
    arrivals: list[float] = []
    source.start(lambda: arrivals.append(time.monotonic()), lambda: None)
    wait_until(lambda: len(arrivals) >= scans)
    source.close()
    time.sleep(0.15)  # one may have been on its way
    return arrivals


def test_scans_are_those_of_the_robot_at_its_pace_in_unix_time() -> None:
    told: list[Scan] = []
    source = SimulationSource(SETTINGS, told.append)
    begun = time.time()
    arrivals = played(source, 25)
    assert (source.kind, source.live, source.error) == ("simulation", True, None)
    assert np.median(np.diff(arrivals)) == pytest.approx(0.1, abs=0.03)
    assert begun < told[0].stamp < time.time() - 2
    assert np.allclose(np.diff([scan.stamp for scan in told]), 0.1, atol=1e-3)
    for scan, expected in zip(told, islice(SimulatedRobot(SETTINGS), 25), strict=False):
        assert np.array_equal(scan.ranges, expected.ranges, equal_nan=True)
        assert np.array_equal(scan.odometry, expected.odometry)
        assert np.array_equal(scan.truth, expected.truth)


def test_scans_are_numbered_and_the_last_ones_can_be_shown_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lidarcore_app.sources.history, "HISTORY", 6)
    told: list[Scan] = []
    source = SimulationSource(SETTINGS, told.append)
    played(source, 12)
    count = source.count
    assert count >= 12
    oldest = count - 6
    assert source.nearest(0) == oldest
    assert source.nearest(count + 5) == count - 1
    assert source.scan(oldest - 1) is None
    for index in range(oldest, count):
        assert source.scan(index) is told[index]
    times = [source.time(index) for index in range(oldest, count)]
    assert all(0.09 < b - a < 0.11 for a, b in pairwise(times))


def test_nothing_comes_after_closing_and_who_fails_to_listen_ends_nothing() -> None:
    def fail(scan: Scan) -> None:
        raise RuntimeError("full")

    source = SimulationSource(SETTINGS, fail)
    assert len(played(source, 5)) >= 5
    count = source.count
    time.sleep(0.3)
    assert source.count == count
