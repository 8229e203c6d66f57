import numpy as np
import pytest
from scipy.stats import binom, chi2
from walks import POSTS, nees, sight, sighting, true_path

from lidarcore.errors import LostError
from lidarcore.geometry import act_inverse
from lidarcore.localization import Localizer, Points
from lidarcore.localization.relocation import relocalize

MAP = Points(POSTS, 1e-6 * np.eye(2), "post")


def test_the_pose_is_found_from_one_scan_and_its_covariance_is_honest() -> None:
    rng = np.random.default_rng(6)
    poses, inside = true_path(110), 0
    for pose in poses:
        found = relocalize(sighting(rng, pose, POSTS[sight(pose)]), MAP)
        inside += nees(found.pose - pose, found.covariance) < chi2.ppf(0.95, 3)
    low, high = binom.ppf([0.001, 0.999], len(poses), 0.95)
    assert low <= inside <= high


def test_points_that_are_not_in_the_map_do_no_harm() -> None:
    rng, pose = np.random.default_rng(7), np.array([3.0, 1.2, 2.0])
    strangers = rng.uniform([0.5, 0.5], [5.5, 4.5], (3, 2))
    found = relocalize(sighting(rng, pose, np.concatenate([POSTS[:9], strangers])), MAP)
    np.testing.assert_allclose(found.pose, pose, atol=0.06)
    assert {(i, i) for i in range(9)} <= set(map(tuple, found.pairs))


def test_in_a_symmetric_room_it_says_that_several_places_look_alike() -> None:
    corners = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [0.0, 4.0]])
    seen = sighting(np.random.default_rng(0), np.array([2.0, 1.0, 0.3]), corners)
    with pytest.raises(LostError, match="Several poses explain 4 of the 4"):
        relocalize(seen, Points(corners, 1e-6 * np.eye(2), "post"))


@pytest.mark.parametrize("count", [0, 1, 3])
def test_too_few_points_are_not_enough(count: int) -> None:
    seen = sighting(np.random.default_rng(0), np.array([2.0, 1.0, 0.3]), POSTS[:count])
    with pytest.raises(LostError, match=rf"of {count} points seen, too few match the map \(4 are needed\)"):
        relocalize(seen, MAP)


def test_a_lost_localizer_goes_on_from_where_it_was_found() -> None:
    rng, pose = np.random.default_rng(9), np.array([9.0, 1.2, -1.0])
    seen = sighting(rng, pose, POSTS[sight(pose)])
    localizer = Localizer(MAP, [1.0, 4.0, 2.0], 1e-4 * np.eye(3))
    assert localizer.step(seen, 0.0, pose).coasting
    found = relocalize(seen, MAP)
    localizer.reset(found.pose, found.covariance)
    estimate = localizer.step(sighting(rng, pose, POSTS[sight(pose)]), 0.1, pose)
    assert not estimate.coasting
    np.testing.assert_allclose(estimate.pose, pose, atol=0.06)


@pytest.mark.parametrize(("count", "size"), [(2000, 100.0), (20_000, 400.0), (5000, 30.0)])
def test_in_a_map_of_thousands_the_pose_is_found(count: int, size: float) -> None:
    rng = np.random.default_rng(count)
    landmarks, pose = rng.uniform(0, size, (count, 2)), np.array([size / 2, size / 3, 1.0])
    near = np.argsort(np.hypot(*(landmarks - pose[:2]).T))[:12]
    z = act_inverse(pose, landmarks[near])
    seen = Points(z + rng.normal(0, 0.01, z.shape), 1e-4 * np.eye(2))
    found = relocalize(seen, Points(landmarks, 1e-6 * np.eye(2)))
    assert nees(found.pose - pose, found.covariance) < chi2.isf(1e-7, 3)


@pytest.mark.parametrize("size", [50.0, 1000.0])
def test_a_map_too_large_to_be_searched_is_refused(size: float) -> None:
    """A hundred thousand landmarks, crowded or not: the distances between all of them would fill 80 gigabytes."""
    rng = np.random.default_rng(3)
    landmarks = Points(rng.uniform(0, size, (100_000, 2)), 1e-4 * np.eye(2))
    seen = Points(rng.uniform(-4, 4, (12, 2)), 1e-4 * np.eye(2))
    with pytest.raises(LostError, match="100000 landmarks is too large to search without a guess: say where"):
        relocalize(seen, landmarks)


def test_a_map_of_too_few_landmarks_or_of_other_kinds_is_named() -> None:
    seen = sighting(np.random.default_rng(0), np.array([2.0, 1.0, 0.3]), POSTS[:6])
    with pytest.raises(LostError, match="The map has 3 landmarks, and 4 are needed"):
        relocalize(seen, MAP.subset(np.arange(3)))
    with pytest.raises(LostError, match="The map holds no post but corner"):
        relocalize(seen, Points(POSTS, 1e-6 * np.eye(2), "corner"))
