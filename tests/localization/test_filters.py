"""What the filters do beside being right on average: coast, recover, keep and drop landmarks."""

from dataclasses import replace

import numpy as np
import pytest
from walks import PERIOD, POSTS, START_COVARIANCE, sight, sighting, true_path, walk

from lidarcore.localization import LocalizationSettings, Localizer, Points, Slam
from lidarcore.localization.visibility import Costs
from lidarcore.scan import Array

SETTINGS = LocalizationSettings()
NOTHING = Points(np.empty((0, 2)), np.eye(2), "post")
EXACT = 1e-6 * np.eye(2)


def see(pose: Array, landmarks: Array, kinds: str = "post") -> Points:
    """The landmarks as an almost exact sensor sees them."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return Points((landmarks - pose[:2]) @ np.array([[c, -s], [s, c]]), EXACT, kinds)


def through_everything(points: Array) -> Costs:
    """The scan shows what is behind all landmarks."""
    return Costs(np.ones(len(points)), np.ones(len(points)))


def nothing(points: Array) -> Costs:
    return Costs(np.zeros(len(points)), np.zeros(len(points)))


def test_without_landmarks_the_filter_coasts_and_finds_back() -> None:
    rng, poses = np.random.default_rng(5), true_path(120)
    path = walk(rng, SETTINGS, poses, [sight(pose) for pose in poses])
    localizer = Localizer(Points(POSTS, EXACT, "post"), poses[0], START_COVARIANCE, SETTINGS)
    size, coasting, error = np.empty(120), np.empty(120, bool), np.empty(120)
    for k in range(120):
        lost = 40 <= k < 70
        estimate = localizer.step(NOTHING if lost else path.sightings[k], PERIOD * k, path.odometry[k])
        size[k], coasting[k] = np.linalg.det(estimate.covariance), estimate.coasting
        error[k] = np.hypot(*(estimate.pose - poses[k])[:2])
    assert coasting.tolist() == [40 <= k < 70 for k in range(120)]
    assert (np.diff(size[39:70]) > 0).all()
    assert size[75] < 2 * size[39]
    assert error[75:].max() < 0.1


def test_a_landmark_of_another_kind_is_never_matched() -> None:
    localizer = Localizer(Points(POSTS, EXACT, "post"), [1, 1, 0], START_COVARIANCE, SETTINGS)
    estimate = localizer.step(see(np.array([1, 1, 0]), POSTS, "corner"), 0.0, np.zeros(3))
    assert estimate.coasting
    assert len(estimate.association.new) == len(POSTS)


def test_a_landmark_that_moved_contradicts_the_others_and_is_left_out() -> None:
    """Each sighting lies in its own wide gate; only together they show which one is wrong."""
    pose = np.array([3.0, 1.5, 0.4])
    seen = see(pose, POSTS[:9])
    xy = seen.xy.copy()
    xy[4] += [0.12, -0.1]
    wide = np.diag([0.1, 0.1, 0.05]) ** 2
    localizer = Localizer(Points(POSTS, EXACT, "post"), pose, wide, SETTINGS)
    estimate = localizer.step(Points(xy, 1e-4 * np.eye(2), "post"), 0.0, np.zeros(3))
    assert estimate.association.incompatible.tolist() == [[4, 4]]
    np.testing.assert_allclose(estimate.pose, pose, atol=2e-3)


def test_the_heading_is_corrected_across_the_seam() -> None:
    pose = np.array([3.0, 1.5, -np.pi + 0.01])
    localizer = Localizer(Points(POSTS, EXACT, "post"), [3.0, 1.5, np.pi - 0.01], START_COVARIANCE, SETTINGS)
    estimate = localizer.step(see(pose, POSTS), 0.0, np.zeros(3))
    np.testing.assert_allclose(estimate.pose, pose, atol=1e-3)


def test_constant_velocity_learns_the_speed_and_the_turn_rate() -> None:
    rng = np.random.default_rng(2)
    settings = LocalizationSettings(motion="constant velocity")
    v, w, centre = 0.8, 0.4, np.array([3.0, 0.6])
    localizer = Localizer(Points(POSTS, EXACT, "post"), [*centre, 0.0], START_COVARIANCE, settings)
    for k in range(30):
        a = w * 0.1 * k
        pose = np.array([centre[0] + v / w * np.sin(a), centre[1] + v / w * (1 - np.cos(a)), a])
        estimate = localizer.step(sighting(rng, pose, POSTS), 0.1 * k)
    assert estimate.velocity is not None
    np.testing.assert_allclose(estimate.velocity, [v, w], atol=0.25)
    np.testing.assert_allclose(estimate.pose, pose, atol=0.05)


def test_a_landmark_is_tentative_until_it_was_seen_often_enough() -> None:
    slam, pose = Slam(replace(SETTINGS, settle=0.0)), np.zeros(3)
    for k in range(SETTINGS.confirm):
        assert not slam.confirmed.any()
        slam.step(see(pose, POSTS[:3]), PERIOD * k, pose)
    assert slam.confirmed.tolist() == [True] * 3
    np.testing.assert_allclose(slam.landmarks.xy, POSTS[:3], atol=0.01)


def test_a_landmark_that_should_be_seen_and_is_not_is_dropped() -> None:
    slam, pose = Slam(SETTINGS), np.zeros(3)
    for k in range(6):
        slam.step(see(pose, POSTS[:4]), PERIOD * k, pose, through_everything)
    for k in range(6, 14):
        slam.step(see(pose, POSTS[1:4]), PERIOD * k, pose, through_everything)
    assert slam.ids.tolist() == [1, 2, 3]
    slam.step(see(pose, POSTS[:4]), PERIOD * 14, pose, through_everything)
    assert slam.ids.tolist() == [1, 2, 3, 4]


def test_a_confirmed_landmark_that_is_out_of_sight_is_kept_and_a_tentative_one_forgotten() -> None:
    slam, pose = Slam(SETTINGS), np.zeros(3)
    for k in range(6):
        slam.step(see(pose, POSTS[:4]), PERIOD * k, pose)
    slam.step(see(pose, POSTS[:5]), PERIOD * 6, pose)
    assert slam.ids.tolist() == [0, 1, 2, 3, 4]
    for k in range(7, 30):
        slam.step(NOTHING, PERIOD * k, pose, nothing)
    assert slam.ids.tolist() == [0, 1, 2, 3]


def test_after_a_loop_every_post_is_in_the_map_once_and_where_it_stands() -> None:
    rng, poses = np.random.default_rng(8), true_path(120)
    path = walk(rng, SETTINGS, poses, [sight(pose) for pose in poses])
    slam = Slam(SETTINGS, poses[0], START_COVARIANCE)
    for k in range(120):
        slam.step(path.sightings[k], PERIOD * k, path.odometry[k])
    landmarks = slam.landmarks
    distance = np.linalg.norm(landmarks.xy[:, None] - POSTS, axis=-1)
    assert sorted(distance.argmin(axis=1)[slam.confirmed]) == list(range(len(POSTS)))
    error = landmarks.xy - POSTS[distance.argmin(axis=1)]
    assert (np.einsum("li,lij,lj->l", error, np.linalg.inv(landmarks.covariance), error) < 18).all()


@pytest.mark.long
def test_the_map_covariance_stays_positive_definite_over_thousands_of_steps() -> None:
    slam, rng = Slam(SETTINGS), np.random.default_rng(3)
    pose = np.array([3.0, 2.0, 0.0])
    for k in range(3000):
        slam.step(sighting(rng, pose, POSTS[:6]), PERIOD * k, pose + 1e-3 * rng.normal(size=3))
    _, S = slam._joint.jointly_expected(np.arange(6), np.zeros((6, 2, 2)))
    assert np.linalg.eigvalsh(S).min() > 0
    assert len(slam.ids) == 6
