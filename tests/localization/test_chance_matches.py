"""Corners that happen to lie on landmarks: by them no pose is found, and none is corrected."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2
from walks import POSTS, nees, sight, sighting, true_path

from lidarcore import extract, open_recording
from lidarcore.errors import LostError
from lidarcore.geometry import relative
from lidarcore.localization import (
    LocalizationSettings,
    Localizer,
    NavigationSettings,
    Navigator,
    Points,
    Slam,
)
from lidarcore.localization.relocation import relocalize


def test_scans_of_another_place_are_not_found_in_a_map() -> None:
    rng, believed = np.random.default_rng(1), 0
    for _ in range(200):
        landmarks = Points(rng.uniform(0, 10, (44, 2)), 0.05**2 * np.eye(2))
        seen = Points(rng.uniform(-4, 4, (rng.integers(4, 8), 2)), 0.05**2 * np.eye(2))
        try:
            relocalize(seen, landmarks)
        except LostError:
            continue
        believed += 1
    assert believed <= 2


def test_in_a_map_of_posts_every_scan_is_found() -> None:
    rng, found = np.random.default_rng(2), 0
    landmarks = Points(POSTS, 0.02**2 * np.eye(2), "post")
    for pose in (poses := true_path(110)[::5]):
        where = relocalize(sighting(rng, pose, POSTS[sight(pose)]), landmarks)
        found += nees(where.pose - pose, where.covariance) < chi2.isf(1e-6, 3)
    assert found == len(poses)


@pytest.mark.parametrize(("sigma", "coasting"), [(0.03, False), (0.5, True)])
def test_a_single_landmark_corrects_a_pose_only_where_it_tells_more_than_chance(
    sigma: float, coasting: bool
) -> None:
    """Half a metre around it there is about one thing in a room; within centimetres there is none but itself."""
    landmarks = Points(POSTS, 1e-4 * np.eye(2))
    localizer = Localizer(landmarks, [6.4, 2.5, 0.0], np.diag([sigma, sigma, 0.01]) ** 2)
    estimate = localizer.step(Points(POSTS[12:13] - [6.4, 2.5], 1e-4 * np.eye(2)), 0.0, (0, 0, 0))
    assert estimate.coasting is coasting
    assert len(estimate.association.ambiguous) == coasting


def test_several_landmarks_together_tell_more_than_each_of_them() -> None:
    rng, pose = np.random.default_rng(3), np.array([3.0, 1.2, 0.3])
    landmarks, vague = Points(POSTS, 1e-4 * np.eye(2), "post"), np.diag([0.5, 0.5, 0.05]) ** 2
    seen = sighting(rng, pose, POSTS[sight(pose)])
    together = Localizer(landmarks, pose, vague).step(seen, 0.0, (0, 0, 0))
    alone = Localizer(landmarks, pose, vague).step(seen.subset(np.arange(1)), 0.0, (0, 0, 0))
    assert alone.coasting
    assert len(together.association.landmark) > 4
    assert nees(together.pose - pose, together.covariance) < chi2.isf(1e-6, 3)


def test_in_a_poor_map_of_corners_it_never_tracks_elsewhere(data: Path) -> None:
    """Rooms full of things: three corners a scan, half of which no map holds."""
    scans = list(open_recording(data / "windsor_rplidar_mat" / "scans_a.mat"))[:220]
    mapping = Navigator(NavigationSettings(mode="slam"))
    mapped = [mapping.step(scan, extract(mapping.deskewed(scan))) for scan in scans]
    start = mapped[0].estimate.pose, 1e-4 * np.eye(3)
    for place in ((), start):
        navigator = Navigator(NavigationSettings(mode="localize"), mapping.landmarks, *place)
        results = [navigator.step(scan, extract(navigator.deskewed(scan))) for scan in scans]
        off = [
            np.hypot(*relative(then.estimate.pose, now.estimate.pose)[:2])
            for then, now in zip(mapped, results, strict=True)
            if now.state == "tracking"
        ]
        assert max(off, default=0.0) < 0.5


def test_a_map_of_corners_takes_none_for_another_where_it_lost_sight_of_them() -> None:
    """Four posts, then half a second in which it sees nothing and may have turned, then something else beside them."""
    rng, slam = np.random.default_rng(4), Slam(LocalizationSettings(motion="constant velocity"))
    posts = np.array([[2.0, 1.0], [2.0, -1.0], [-1.5, 1.2], [-1.0, -1.5]])
    noise = 0.01**2 * np.eye(2)
    for k in range(20):
        slam.step(Points(posts + rng.normal(0, 0.01, posts.shape), noise), 0.1 * k)
    assert slam.confirmed.all()
    for k in range(20, 29):
        slam.step(Points(np.empty((0, 2)), np.eye(2)), 0.1 * k)
    before = slam.step(Points(np.empty((0, 2)), np.eye(2)), 2.9)
    beside = slam.step(Points(posts[:1] + 0.9, noise), 3.0)
    assert np.sqrt(before.covariance[0, 0]) > 0.3
    assert beside.coasting
    together = slam.step(Points(posts + rng.normal(0, 0.01, posts.shape), noise), 3.1)
    assert len(together.association.landmark) == 4
    assert np.hypot(*together.pose[:2]) < 0.05
