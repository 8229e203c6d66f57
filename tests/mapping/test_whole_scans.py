"""SLAM from whole scans while it runs: a simulated robot that knows its true poses."""

import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from scipy.stats import chi2
from waiting import wait_until

from lidarcore.geometry import relative, wrap
from lidarcore.localization import TrackingResult
from lidarcore.mapping import WholeScans
from lidarcore.mapping.walls import WallTable
from lidarcore.noise import SensorNoise
from lidarcore.scan import Array, Scan
from lidarcore.settings import ExtractionSettings
from lidarcore.simulation import SimulatedSensor, furnished_room
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

SCANS = 400  # 40 s, more than one round


@pytest.fixture(scope="module")
def drive() -> list[Scan]:
    settings = SimulationSettings(world="two rooms", seed=5)
    return list(islice(SimulatedRobot(settings), SCANS))


@pytest.fixture
def slam() -> Iterator[WholeScans]:
    running = WholeScans()
    yield running
    running.close()


def followed(slam: WholeScans, scans: list[Scan]) -> list[TrackingResult]:
    return [slam.step(slam.deskewed(scan)) for scan in scans]


def true_pose(scans: list[Scan], k: int) -> Array:
    """In the frame of the map, which begins where the first scan was taken."""
    first, then = scans[0].truth, scans[k].truth
    assert first is not None
    assert then is not None
    return relative(first, then)


def test_a_robot_that_drives_through_two_rooms_is_tracked_all_the_way(
    slam: WholeScans, drive: list[Scan]
) -> None:
    results = followed(slam, drive)
    assert {result.state for result in results} == {"tracking"}
    wait_until(lambda: not slam.is_behind)
    last = slam.step(slam.deskewed(drive[-1])).estimate
    error = last.pose - true_pose(drive, -1)
    error[2] = wrap(error[2])
    print(error, np.sqrt(np.diag(last.covariance)))
    assert np.hypot(*error[:2]) < 0.1
    assert error @ np.linalg.solve(last.covariance, error) < chi2.isf(1e-6, 3)


def test_a_map_whose_first_scan_is_long_in_coming_has_it_all_the_same(
    slam: WholeScans, drive: list[Scan], caplog: pytest.LogCaptureFixture
) -> None:
    """The thread of the map looks for something to draw once a second."""
    time.sleep(1.5)
    slam.step(slam.deskewed(drive[0]))
    wait_until(lambda: slam.picture is not None)
    assert caplog.records == []


def test_a_sensor_at_rest_stays_there_where_its_scans_arrive_late(slam: WholeScans) -> None:
    """Held up for a second and a half, then one upon another. By stamps a millisecond apart it moved 3 to 6 m."""
    rng, sensor, stamp = np.random.default_rng(0), SimulatedSensor(furnished_room()), 0.0
    for k in range(120):
        scan, _ = sensor.scan(np.array([0.5, 0.3, 0.4]), rng, stamp)
        found = slam.step(slam.deskewed(scan))
        assert np.hypot(*found.estimate.pose[:2]) < 0.01
        stamp += (0.1, 1.5, 0.001, 0.001, 0.001, 0.002, 0.1)[k % 7]


def test_the_map_goes_on_after_a_pause_in_which_the_robot_drove_on(
    slam: WholeScans, drive: list[Scan]
) -> None:
    """Nobody looked for 14 s and 7 m; wheels tell of the way."""
    before, after = drive[:150], drive[290:330]
    way = relative(true_pose(drive, 149), true_pose(drive, 290))
    assert before[-1].odometry is not None
    assert after[0].odometry is not None
    driven = relative(before[-1].odometry, after[0].odometry)
    print(way, driven)
    followed(slam, before)
    last = followed(slam, after)[-1]
    assert last.state == "tracking"
    assert len(slam.path()) > 10  # not a map that has just begun
    assert np.hypot(*(last.estimate.pose - true_pose(drive, 329))[:2]) < 0.3


def test_a_clock_that_is_set_back_costs_two_scans_and_not_the_map(
    slam: WholeScans, drive: list[Scan]
) -> None:
    scans = drive[:60] + [replace(scan, stamp=scan.stamp - 100) for scan in drive[60:120]]
    results = followed(slam, scans)
    assert {result.state for result in results} == {"tracking"}
    said = {k: str(result.message) for k, result in enumerate(results) if result.message}
    assert sorted(said) == [60, 61, 62]
    assert all("The clock went back by" in message for message in said.values())
    assert "skipped" in said[60]
    assert "continues" in said[62]
    error = results[-1].estimate.pose - true_pose(drive, 119)
    assert np.hypot(*error[:2]) < 0.1
    assert len(slam.path()) > 15


def test_walls_catch_up_when_no_more_scans_come(slam: WholeScans, drive: list[Scan]) -> None:
    followed(slam, drive[:150])

    def is_complete() -> bool:
        walls = None if slam.picture is None else slam.picture.walls
        return walls is not None and bool(walls.last_seen.max() >= drive[130].stamp)

    wait_until(is_complete)


def test_a_noise_that_is_set_on_the_way_is_that_of_poses_and_walls_from_then_on(
    slam: WholeScans, drive: list[Scan]
) -> None:
    def found() -> WallTable | None:
        return slam.picture.walls if slam.picture else None

    def longest(walls: WallTable | None) -> float:
        """m² of how far from the map's origin it is."""
        assert walls is not None
        return float(walls.line_covariance[np.argmax(walls.length), 1, 1])

    pose = followed(slam, drive[:4])[-1].estimate.covariance
    wait_until(lambda: found() is not None and not slam.is_behind)
    walls = found()
    slam.renew(ExtractionSettings(noise=SensorNoise(0.1, 0.001)))  # ten times that of the simulation
    wait_until(lambda: found() is not walls)
    assert longest(found()) > 4 * longest(walls)
    noisier = followed(slam, drive[4:5])[-1].estimate.covariance
    assert (np.diagonal(noisier) > 2 * np.diagonal(pose)).all()


def test_what_is_kept_at_the_end_knows_the_last_scans(drive: list[Scan]) -> None:
    """At this speed walls are sought once or twice; the rest of the drive is kept only as it ends."""
    kept = []
    slam = WholeScans(begin_map=lambda: lambda grid, walls: kept.append((grid, walls)))
    followed(slam, drive[:300])
    wait_until(lambda: not slam.is_behind)
    before = len(kept)
    slam.close()
    assert len(kept) == before + 1
    grid, walls = kept[-1]
    assert walls.last_seen.max() >= drive[290].stamp
    assert grid.free.sum() * grid.resolution**2 > 40
