"""The Navigator beside being right: finds itself, survives bad clocks and wheels, says what is wrong."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from living_room import (
    EXTRACTION,
    PERIOD,
    ROOM,
    living_room,
    navigate,
    nearest_corners,
    pose_error,
    room_corners,
    with_odometry,
)
from scipy.stats import chi2

from lidarcore import Scan, SensorNoise, extract
from lidarcore.clusters import cluster
from lidarcore.errors import CovarianceError, LocalizationError
from lidarcore.geometry import compose, inverse
from lidarcore.localization import Landmarks, NavigationSettings, Navigator, Points
from lidarcore.simulation.posts import Posts
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

MAP = Points(room_corners(), 1e-6 * np.eye(2))
LOCALIZE, SLAM = NavigationSettings(mode="localize"), NavigationSettings(mode="slam")
WHEELS = np.array([-7.0, 3.0, 2.0])  # where the wheels' own frame begins


def wheeled(count: int, begin: float = 0.0) -> Iterator[Scan]:
    return with_odometry(living_room("moving", count, begin=begin), WHEELS)


def bare(scan: Scan) -> Scan:
    return replace(scan, odometry=None)


@pytest.mark.parametrize("path", ["standing", "moving"])
def test_in_a_known_map_the_pose_is_found_from_nothing_and_kept_without_odometry(path: str) -> None:
    steps = [
        (where, pose_error(where, scan.truth))
        for scan, where in navigate(Navigator(LOCALIZE, MAP), living_room(path, 60, seed=3))
        if scan.truth is not None
    ]
    states = [where.state for where, _ in steps]
    begun = states.index("tracking")
    assert begun < 20
    assert states == ["starting"] * begun + ["tracking"] * (60 - begun)
    assert all(where.message for where, _ in steps[:begun])
    assert max(np.hypot(*error[:2]) for _, error in steps[begun:]) < 0.03
    squares = [error @ np.linalg.solve(where.estimate.covariance, error) for where, error in steps[begun:]]
    assert np.mean(np.array(squares) < chi2.ppf(0.95, 3)) > 0.9


BREAKS: dict[str, tuple[Callable[[Scan], Scan], str, int]] = {
    "the encoder was reset": (
        lambda scan: replace(scan, odometry=compose(np.array([40.0, 3.0, 1.0]), scan.odometry)),
        "Odometry jumped by",
        2,
    ),
    "the clock went back": (lambda scan: replace(scan, stamp=scan.stamp - 100), "The clock went back by", 2),
    "odometry is missing": (bare, "The scan has no odometry", 2),
}


@pytest.mark.parametrize("case", BREAKS)
def test_a_break_of_clock_or_odometry_leaves_scans_out_and_then_it_goes_on(case: str) -> None:
    """From the thirtieth scan on; missing odometry comes back after ten, and a constant velocity fills in."""
    damage, message, left_out = BREAKS[case]
    last = 40 if case == "odometry is missing" else 60

    def change(k: int, scan: Scan) -> Scan:
        return damage(scan) if 30 <= k < last else scan

    before = None
    for k, (scan, where) in enumerate(
        navigate(Navigator(LOCALIZE, MAP, [4.6, 4, 0], np.eye(3) / 100), wheeled(60), change)
    ):
        if 30 <= k < 30 + left_out:
            assert before is not None
            assert where.message is not None
            assert where.message.startswith(message)
            assert where.message.endswith("the scan was skipped.")
            np.testing.assert_array_equal(where.estimate.pose, before.estimate.pose)
            np.testing.assert_array_equal(where.estimate.covariance, before.estimate.covariance)
            assert (len(where.pairs), where.dof, where.nis) == (0, 0, 0.0)
        elif case == "odometry is missing" and 30 <= k < last:
            assert where.message is not None
            assert "constant velocity" in where.message
        elif k >= (last if case == "odometry is missing" else 30 + left_out) + 3:
            assert where.message is None
            assert scan.truth is not None
            assert np.hypot(*pose_error(where, scan.truth)[:2]) < 0.03
        before = where


def test_odometry_that_is_not_finite_leaves_the_scan_out() -> None:
    navigator = Navigator(LOCALIZE, MAP, [4.6, 4, 0], np.eye(3) / 100)
    first, second = wheeled(2)
    before = navigator.step(first, extract(first, EXTRACTION))
    where = navigator.step(second, extract(second, EXTRACTION), odometry=[np.nan, 0, 0])
    assert where.message is not None
    assert "odometry is [nan" in where.message
    np.testing.assert_array_equal(where.estimate.pose, before.estimate.pose)


def test_odometry_that_comes_a_little_later_is_used() -> None:
    steps = list(navigate(Navigator(SLAM), wheeled(20), lambda k, scan: bare(scan) if k < 3 else scan))
    (_, before), (_, where) = steps[-2:]
    assert before.dead_reckoned is not None
    assert where.dead_reckoned is not None
    increment = compose(inverse(before.dead_reckoned), where.dead_reckoned)
    # One correction changes what odometry said by less than what a constant velocity would have missed.
    assert where.estimate.velocity == pytest.approx(increment[[0, 2]] / (where.stamp - before.stamp), abs=0.1)


def test_dead_reckoning_is_odometry_from_the_start_pose() -> None:
    start = np.array([4.6, 4.0, 0.0])
    for scan, where in navigate(Navigator(LOCALIZE, MAP, start, np.eye(3) / 100), wheeled(20)):
        assert where.dead_reckoned is not None
        assert scan.truth is not None
        if scan.stamp == 0:
            offset = where.estimate.pose - scan.truth
        assert np.hypot(*(where.dead_reckoned - scan.truth)[:2]) < np.hypot(*offset[:2]) + 0.05


@pytest.mark.parametrize("mode", ["localize", "slam"])
def test_a_sensor_that_is_carried_away_is_lost_and_finds_itself_again(mode: str) -> None:
    """After fifty scans it is elsewhere in the room, and SLAM does not map the room a second time."""
    here = list(living_room("moving", 50, seed=1))
    there = list(living_room("moving", 50, seed=1, begin=45.0))
    shifted = (replace(scan, stamp=scan.stamp - 40.0) for scan in there)
    settings = NavigationSettings(mode="slam" if mode == "slam" else "localize")
    known = Landmarks.of(MAP)
    navigator = Navigator(settings, known)
    states = []
    for scan, where in navigate(navigator, iter([*here, *shifted])):
        truth = scan.truth
        states.append(where.state)
    assert truth is not None
    assert "lost" in states[50:]
    assert states[-1] == "tracking"
    assert np.hypot(*pose_error(where, truth)[:2]) < 0.05
    nearest, _ = nearest_corners(where.landmarks, np.zeros(3))
    assert len(set(nearest)) == len(nearest)


def test_a_pose_set_by_hand_is_taken_and_a_bad_one_refused() -> None:
    navigator = Navigator(LOCALIZE, MAP)
    scan = next(living_room("moving", 1))
    assert scan.truth is not None
    for bad, error in (([np.nan, 0, 0], LocalizationError), ([0, 0], LocalizationError)):
        with pytest.raises(error):
            navigator.place(bad, np.eye(3))
    with pytest.raises(CovarianceError):
        navigator.place(scan.truth, np.zeros((3, 3)))
    navigator.place(scan.truth, np.diag([0.05, 0.05, 0.02]) ** 2)
    where = navigator.step(scan, extract(scan, EXTRACTION))
    assert where.state == "tracking"
    assert np.hypot(*pose_error(where, scan.truth)[:2]) < 0.1


@pytest.mark.parametrize(
    ("settings", "landmarks", "message"),
    [
        (NavigationSettings(), MAP, "Navigation is off"),
        (LOCALIZE, None, "no map"),
        (LOCALIZE, Points(np.empty((0, 2)), np.eye(2)), "no map"),
    ],
)
def test_without_a_mode_or_a_map_there_is_no_navigator(
    settings: NavigationSettings, landmarks: Points | None, message: str
) -> None:
    with pytest.raises(LocalizationError, match=message):
        Navigator(settings, landmarks)


def test_ids_of_a_map_that_is_gone_on_with_are_kept_and_new_ones_are_new() -> None:
    half = MAP.subset(MAP.xy[:, 0] > 4)
    known = Landmarks(
        np.arange(100, 100 + len(half)),
        half,
        np.ones(len(half), bool),
        np.full(len(half), 9),
        np.zeros(len(half)),
        np.zeros(len(half)),
    )
    navigator = Navigator(SLAM, known, [7.6, 4.4, 0], np.eye(3) / 1e4)
    *_, (_, where) = navigate(navigator, living_room("standing", 40))
    assert where.state == "tracking"
    assert set(known.ids) <= set(where.landmarks.ids)
    assert where.landmarks.ids[len(known) :].min(initial=10_000) >= 100 + len(half)


def test_pairs_name_landmarks_that_were_in_the_map() -> None:
    known: set[int] = set()
    for _, where in navigate(Navigator(SLAM), living_room("moving", 30)):
        for pairs in (where.pairs, where.tentative, where.ambiguous):
            assert set(pairs[:, 1].tolist()) <= known
        seen = np.concatenate(
            [where.pairs[:, 0], where.tentative[:, 0], where.ambiguous[:, 0], where.unmatched]
        )
        assert set(seen.tolist()) <= set(range(len(where.observed)))
        assert set(where.removed.tolist()) == known - set(where.landmarks.ids.tolist())
        known = set(where.landmarks.ids.tolist())


def test_without_landmarks_a_new_map_is_begun_when_the_pose_is_lost() -> None:
    """A round wall has no corners."""
    bearings = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    navigator, messages, variances = Navigator(SLAM), [], []
    for k in range(40):
        scan = Scan(np.full(360, 3.0), bearings, PERIOD * k)
        where = navigator.step(scan, extract(scan, EXTRACTION))
        messages.append(where.message)
        variances.append(where.estimate.covariance[0, 0])
        assert where.state == "starting"
    assert any(message and "a new map was started" in message for message in messages)
    assert variances == sorted(variances)  # a new map does not make up for what was lost


def test_where_clusters_are_landmarks_posts_become_some_and_people_do_not() -> None:
    posts = np.array([[5.5, 1.2], [5.0, 6.5], [1.4, 5.8], [4.6, 2.4], [8.0, 5.6]])
    navigator = Navigator(
        NavigationSettings(mode="slam", landmarks="clusters"), None, [4.6, 4.0, 0.0], np.eye(3) / 1e6
    )
    scans = with_odometry(living_room("moving", 150, posts=Posts(posts, 0.06)), WHEELS)
    for scan in scans:
        where = navigator.step(scan, extract(scan, EXTRACTION), cluster(scan))
        assert scan.truth is not None
        assert np.hypot(*pose_error(where, scan.truth)[:2]) < 0.1
    found = where.landmarks.points.xy[where.landmarks.confirmed]
    distance = np.linalg.norm(found[:, None] - posts, axis=-1)
    assert len(set(distance.argmin(axis=1)[distance.min(axis=1) < 0.15])) >= 3
    on_a_wall = np.array([ROOM.clearance(*at) < 0.3 for at in found])
    assert (on_a_wall | (distance.min(axis=1) < 0.15)).all()


def test_clusters_as_landmarks_need_clusters() -> None:
    scan = next(living_room("standing", 1))
    navigator = Navigator(NavigationSettings(mode="slam", landmarks="clusters"))
    with pytest.raises(LocalizationError, match="find them in the scan first"):
        navigator.step(scan, extract(scan, EXTRACTION))


def test_a_sensor_noisier_than_told_is_believed_less() -> None:
    scan = next(living_room("standing", 1))
    told = [
        Navigator(SLAM).step(scan, extract(scan, replace(EXTRACTION, noise=SensorNoise(sigma, 0.001))))
        for sigma in (0.002, 0.01)
    ]
    sizes = [np.trace(where.observed.covariance, axis1=1, axis2=2).mean() for where in told]
    assert sizes[0] > 0.8 * sizes[1]


@pytest.mark.long
@pytest.mark.parametrize("gap", [100, 300])
def test_after_a_long_gap_the_pose_is_made_sure_of_before_anything_is_matched(gap: int) -> None:
    """In two rooms that look alike; seed 0, whose odometry is three of its sigmas off after ten seconds."""
    navigator, start = Navigator(SLAM), None
    scans = islice(SimulatedRobot(SimulationSettings(world="two rooms", seed=0), begin=1e9), 200 + gap + 150)
    for k, scan in enumerate(scans):
        if 200 <= k < 200 + gap:
            continue
        seen = navigator.deskewed(scan)
        where = navigator.step(seen, extract(seen, EXTRACTION))
        assert scan.truth is not None
        start = compose(where.estimate.pose, inverse(scan.truth)) if start is None else start
        error = where.estimate.pose - compose(start, scan.truth)
        if where.state == "tracking" and k > 200:
            assert np.hypot(*error[:2]) < 0.15
    assert where.state == "tracking"
