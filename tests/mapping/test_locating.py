"""Localizing in a known grid by whole scans: simulated robots that know their true poses, and a real building."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from waiting import wait_until

from lidarcore import open_recording
from lidarcore.errors import CovarianceError, LocalizationError
from lidarcore.evaluation.maps.accuracy import reference_poses
from lidarcore.geometry import act, compose, pose_difference, relative, squared_mahalanobis
from lidarcore.localization import TrackingResult
from lidarcore.mapping import MapPicture, WholeScans
from lidarcore.mapping.grid import OccupancyGrid, build_grid
from lidarcore.mapping.live import locate_worker
from lidarcore.mapping.matching.front import FrontEnd
from lidarcore.mapping.settings import MapperSettings
from lidarcore.noise import SensorNoise
from lidarcore.scan import Array, Scan
from lidarcore.settings import ExtractionSettings
from lidarcore.simulation import SimulatedSensor, World, rooms
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

SETTINGS = ExtractionSettings(noise=SensorNoise(0.01, 0.001))
FRAME = np.array([20.0, -5.0, 2.5])
"""T_map_world: maps have frames of their own."""
NEAR = np.diag([0.2, 0.2, 0.15]) ** 2


def truth(scan: Scan) -> Array:
    assert scan.truth is not None
    return compose(FRAME, scan.truth)


@pytest.fixture(scope="module")
def drive() -> list[Scan]:
    return list(islice(SimulatedRobot(SimulationSettings(world="furnished room", seed=4)), 340))


@pytest.fixture(scope="module")
def known() -> MapPicture:
    """Of an earlier drive."""
    scans = list(islice(SimulatedRobot(SimulationSettings(world="furnished room", seed=9)), 0, 400, 8))
    return MapPicture(build_grid(scans, np.array([truth(scan) for scan in scans])))


@pytest.fixture
def tracker(known: MapPicture) -> Iterator[WholeScans]:
    with closing(WholeScans(SETTINGS, known=known, background=False)) as running:
        yield running


def followed(tracker: WholeScans, scans: list[Scan]) -> list[TrackingResult]:
    return [tracker.step(tracker.deskewed(scan)) for scan in scans]


def errors(results: list[TrackingResult], scans: list[Scan]) -> Array:
    """(N, 3) of the scans that are said to be tracked."""
    return np.array(
        [
            pose_difference(one.estimate.pose, truth(scan))
            for one, scan in zip(results, scans, strict=True)
            if one.state == "tracking"
        ]
    ).reshape(-1, 3)


def blind(scans: list[Scan]) -> list[Scan]:
    return [replace(scan, odometry=None) for scan in scans]


@pytest.mark.parametrize("wheels", [True, False])
def test_the_pose_is_found_without_a_guess_and_kept(
    tracker: WholeScans, drive: list[Scan], wheels: bool
) -> None:
    scans = drive if wheels else blind(drive)
    results = followed(tracker, scans)
    states = [one.state for one in results]
    assert {one.mode for one in results} == {"localize"}
    assert states[0] != "tracking"  # one view is not enough
    assert states.count("tracking") > 0.7 * len(states)
    off = errors(results, scans)
    assert np.hypot(*off[:, :2].T).max() < 0.1
    assert np.abs(off[:, 2]).max() < 0.03
    claims = np.array([one.estimate.covariance for one in results if one.state == "tracking"])
    assert np.median(squared_mahalanobis(off, claims)) < 2.37  # of a chi-square with three degrees of freedom
    assert np.sqrt(claims[:, 0, 0]).max() < 0.1


@pytest.mark.parametrize("wheels", [True, False])
def test_a_robot_that_is_carried_elsewhere_is_found_again(
    tracker: WholeScans, drive: list[Scan], wheels: bool
) -> None:
    """Its wheels tell nothing of that."""
    before, after = drive[:120], drive[240:340]
    shift = after[0].stamp - before[-1].stamp - 0.1
    assert before[-1].odometry is not None
    carried = [
        replace(
            scan,
            stamp=scan.stamp - shift,
            odometry=compose(before[-1].odometry, relative(after[0].odometry, scan.odometry))
            if wheels and scan.odometry is not None and after[0].odometry is not None
            else None,
        )
        for scan in after
    ]
    scans = [*(before if wheels else blind(before)), *carried]
    assert np.hypot(*(truth(after[0]) - truth(before[-1]))[:2]) > 1.0
    results = followed(tracker, scans)
    assert results[119].state == "tracking"
    assert results[-1].state == "tracking"
    off = np.hypot(*errors(results[-30:], scans[-30:])[:, :2].T)
    assert off.max() < 0.1
    assert np.hypot(*errors(results, scans)[:, :2].T).max() < 0.3  # never tracked where it is not


def test_where_two_places_look_alike_a_person_can_say_which() -> None:
    room, rng = rooms.rectangular_room(6, 4), np.random.default_rng(1)
    poses = np.array([[x, 0.3, 0.2] for x in np.linspace(-1.5, 1.5, 16)])
    sensor = SimulatedSensor(room, SETTINGS.noise)
    scans = [
        replace(sensor.scan(pose, rng)[0], stamp=0.5 * k, truth=pose, odometry=pose)
        for k, pose in enumerate(poses)
    ]
    picture = MapPicture(build_grid(scans, np.array([truth(scan) for scan in scans])))
    with closing(WholeScans(SETTINGS, known=picture, background=False)) as tracker:
        results = followed(tracker, scans[:10])
        assert {one.state for one in results} == {"starting"}
        assert "several places" in (results[-1].message or "")
        tracker.place(truth(scans[9]) + np.array([0.15, -0.1, 0.1]), NEAR)
        results = followed(tracker, scans[10:])
    assert {one.state for one in results} == {"tracking"}
    assert np.abs(errors(results, scans[10:])).max() < 0.08


def test_a_sensor_that_stands_is_found_once_nobody_stands_before_what_tells_where_it_is() -> None:
    """The room looks the same from either end, but for a closet in one corner; it stands 0.2 m from its keyframe."""
    room, rng, here = rooms.rectangular_room(6, 4), np.random.default_rng(1), np.array([0.5, 0.4, 0.3])
    closet = np.array([[[2.2, -2.0], [2.2, -1.0]], [[2.2, -1.0], [3.0, -1.0]]])
    sensor = SimulatedSensor(World(np.concatenate([room.walls, closet])), SETTINGS.noise)
    poses = np.array([[x, 0.3, 0.2] for x in np.linspace(-1.5, 1.5, 16)])
    picture = MapPicture(build_grid([sensor.scan(pose, rng)[0] for pose in poses], poses))
    results = []
    with closing(WholeScans(SETTINGS, known=picture, background=False)) as tracker:
        for k in range(24):
            pose = here if k else compose(here, np.array([-0.2, 0.0, 0.0]))
            scan = replace(sensor.scan(pose, rng)[0], stamp=0.5 * k)
            x, y = act(pose, scan.xy).T
            hidden = (x > 2) & (y < -0.7) & (k < 10)
            results.append(tracker.step(replace(scan, ranges=np.where(hidden, 0.5, scan.ranges))))
    assert {one.state for one in results[:10]} == {"starting"}
    assert "several places" in (results[9].message or "")
    assert results[-1].state == "coasting"
    assert np.abs(pose_difference(results[-1].estimate.pose, here)).max() < 0.03


def test_of_a_long_drive_the_newest_part_of_the_path_is_kept(
    known: MapPicture, drive: list[Scan], monkeypatch: pytest.MonkeyPatch
) -> None:
    with closing(WholeScans(SETTINGS, known=known, background=False)) as whole:
        expected = followed(whole, drive[:200])[-1]
        path = whole.path()
    monkeypatch.setattr(locate_worker, "_PATH", 5)
    with closing(WholeScans(SETTINGS, known=known, background=False)) as tracker:
        found = followed(tracker, drive[:200])[-1]
        assert len(path) > 10
        assert np.array_equal(tracker.path(), path[-6:])
    assert np.array_equal(found.estimate.pose, expected.estimate.pose)


def test_a_pose_told_wrongly_is_not_tracked(tracker: WholeScans, drive: list[Scan]) -> None:
    wrong = truth(drive[0]) + np.array([1.5, 1.0, 1.0])
    tracker.place(wrong, NEAR)
    results = followed(tracker, drive[:150])
    off = errors(results, drive[:150])
    assert len(off)
    assert np.hypot(*off[:, :2].T).max() < 0.1


def test_who_is_lost_with_the_first_scan_is_found_by_the_next_ones(
    tracker: WholeScans, drive: list[Scan]
) -> None:
    """Told to be far outside of the map: what was seen from there is not taken for a view of it."""
    tracker.place(truth(drive[0]) + np.array([100.0, 0.0, 0.0]), np.diag([2.0, 2.0, 0.3]) ** 2)
    off = errors(followed(tracker, drive[:200]), drive[:200])
    assert len(off)
    assert np.hypot(*off[:, :2].T).max() < 0.1


def test_poses_and_covariances_that_are_none_are_refused(tracker: WholeScans) -> None:
    with pytest.raises(LocalizationError, match="pose"):
        tracker.place((0.0, np.nan, 0.0), NEAR)
    with pytest.raises(CovarianceError):
        tracker.place((0.0, 0.0, 0.0), np.zeros((3, 3)))


def test_scans_do_not_wait_for_the_search(known: MapPicture, drive: list[Scan]) -> None:
    """In a thread of its own the pose comes when it is found."""
    with closing(WholeScans(SETTINGS, known=known)) as tracker:
        for scan in drive[:200]:
            tracker.step(tracker.deskewed(scan))
            wait_until(lambda: not tracker.is_behind)
        last = drive[200]
        wait_until(lambda: tracker.step(tracker.deskewed(replace(last))).state == "tracking")
        here = tracker.step(tracker.deskewed(last)).estimate.pose
    assert np.abs(pose_difference(here, truth(last))).max() < 0.1


@pytest.mark.parametrize("background", [True, False])
def test_a_map_without_anything_in_it_says_so(drive: list[Scan], background: bool) -> None:
    empty = MapPicture(OccupancyGrid(np.zeros((9, 9)), 0.05, np.zeros(3)))
    with closing(WholeScans(known=empty, background=background)) as tracker:
        if not background:
            with pytest.raises(LocalizationError, match="Nothing is occupied"):
                tracker.step(drive[0])
            return
        tracker.step(drive[0])
        wait_until(lambda: "Nothing is occupied" in (tracker.step(drive[0]).message or ""))


def test_in_a_map_without_anything_in_it_no_keyframe_is_left_waiting(drive: list[Scan]) -> None:
    """What is not joined to the map would be gone through again at each scan, and there would be ever more of it."""
    empty = MapPicture(OccupancyGrid(np.zeros((9, 9)), 0.05, np.zeros(3)))
    settings = MapperSettings().with_noise(SETTINGS.noise)
    front = FrontEnd(settings.front)
    keyframes = [tracked for tracked in map(front.step, drive[:120]) if tracked.keyframe]
    with closing(locate_worker.LocateWorker(empty, settings.drift_covariance, background=True)) as worker:
        for tracked in keyframes:
            worker.put(tracked)
        wait_until(lambda: worker.corrected.keyframes == len(keyframes))
    assert len(keyframes) > 3


@pytest.mark.real_data
@pytest.mark.long
def test_a_real_robot_is_never_tracked_where_it_is_not(data: Path) -> None:
    """Intel: the first 60 % make the map, from reference poses; the rest drives through it and beyond."""
    scans = list(open_recording(data / "carmen_radish_corrected" / "intel-corrected.log.gz"))
    poses, _ = reference_poses(scans)
    first = int(0.6 * len(scans))
    picture = MapPicture(build_grid(scans[:first], poses[:first]))
    off = []
    with closing(WholeScans(known=picture, background=False)) as tracker:
        for scan, pose in zip(scans[first:], poses[first:], strict=True):
            found = tracker.step(tracker.deskewed(scan))
            if found.state == "tracking":
                off.append(np.hypot(*pose_difference(found.estimate.pose, pose)[:2]))
    print(len(off), np.median(off), np.max(off))
    assert len(off) > 100
    assert np.max(off) < 0.5
