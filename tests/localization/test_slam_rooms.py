"""SLAM from the scans alone, where people walk: the map is the room's corners, each once, and the pose is honest."""

import numpy as np
import pytest
from living_room import living_room, navigate, nearest_corners, pose_error
from scipy.stats import chi2

from lidarcore.geometry import compose, inverse
from lidarcore.localization import LocalizationSettings, NavigationSettings, Navigator, TrackingResult
from lidarcore.scan import Array

SETTINGS = NavigationSettings(mode="slam", filter=LocalizationSettings(unevenness=0.0))
COUNT = 150


@pytest.fixture(scope="module", params=["standing", "moving"])
def run(request: pytest.FixtureRequest) -> tuple[Array, list[tuple[Array, TrackingResult]]]:
    """The start in the room, and after each scan the true pose in the frame that begins there, and the whereabouts."""
    steps = [
        (scan.truth, where)
        for scan, where in navigate(Navigator(SETTINGS), living_room(request.param, COUNT))
        if scan.truth is not None
    ]
    start = steps[0][0]
    return start, [(compose(inverse(start), truth), where) for truth, where in steps]


def test_every_confirmed_landmark_is_a_corner_of_the_room_and_no_corner_is_there_twice(
    run: tuple[Array, list[tuple[Array, TrackingResult]]],
) -> None:
    start, steps = run
    nearest, errors = nearest_corners(steps[-1][1].landmarks, start)
    assert len(nearest) >= 8
    assert len(set(nearest)) == len(nearest)
    assert np.hypot(*errors.T).max() < 0.1


def test_the_map_stays(run: tuple[Array, list[tuple[Array, TrackingResult]]]) -> None:
    _, steps = run
    confirmed: set[int] = set()
    for _, where in steps:
        ids = set(where.landmarks.ids[where.landmarks.confirmed].tolist())
        assert confirmed <= ids
        confirmed = ids


def test_the_pose_is_off_by_no_more_than_it_claims(
    run: tuple[Array, list[tuple[Array, TrackingResult]]],
) -> None:
    _, steps = run
    errors = np.array([pose_error(where, truth) for truth, where in steps])
    squares = [
        error @ np.linalg.solve(where.estimate.covariance, error)
        for error, (_, where) in zip(errors, steps, strict=True)
    ]
    assert np.hypot(*errors[:, :2].T).max() < 0.05
    assert np.mean(np.array(squares) < chi2.ppf(0.95, 3)) > 0.8


def test_the_innovations_are_as_large_as_the_filter_expects(
    run: tuple[Array, list[tuple[Array, TrackingResult]]],
) -> None:
    """White accelerations allow for more than this sensor does, so they may be smaller, never larger."""
    _, steps = run
    nis, dof = sum(where.nis for _, where in steps), sum(where.dof for _, where in steps)
    assert dof > 1000
    assert 0.5 * dof < nis < chi2.ppf(0.999, dof)


def test_it_tracks_from_the_first_confirmed_landmark_on(
    run: tuple[Array, list[tuple[Array, TrackingResult]]],
) -> None:
    states = [where.state for _, where in run[1]]
    begun = states.index("tracking")
    assert states == ["starting"] * begun + ["tracking"] * (COUNT - begun)
    assert all(where.message is None for _, where in run[1])
