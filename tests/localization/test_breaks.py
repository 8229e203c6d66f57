"""Odometry that comes late, clocks that stand still, and maps begun anew: what is claimed is no more than is known."""

from dataclasses import replace

import numpy as np
import pytest
from living_room import EXTRACTION, living_room, navigate, pose_error, room_corners, with_odometry

from lidarcore import Scan, extract
from lidarcore.geometry import compose, inverse
from lidarcore.localization import Landmarks, NavigationSettings, Navigator, Points
from lidarcore.localization.map_origin import MapOrigin

MAP = Points(room_corners(), 1e-6 * np.eye(2))
LOCALIZE, SLAM = NavigationSettings(mode="localize"), NavigationSettings(mode="slam")
START, WHEELS = np.array([4.6, 4.0, 0.0]), np.array([-7.0, 3.0, 2.0])


def jumping(k: int, scan: Scan) -> Scan:
    assert scan.odometry is not None
    return replace(scan, odometry=scan.odometry + np.array([10.0 * k, 0, 0]))


@pytest.mark.parametrize("settings", [LOCALIZE, SLAM])
def test_odometry_that_comes_late_is_used_without_losing_the_map(settings: NavigationSettings) -> None:
    """After sixty scans; that it is used shows when it jumps at each scan."""
    navigator = Navigator(settings, MAP if settings is LOCALIZE else None, START, np.eye(3) / 1e4)
    known: set[int] = set()

    def late(k: int, scan: Scan) -> Scan:
        if k < 60:
            return replace(scan, odometry=None)
        return scan if k < 70 else jumping(k, scan)

    for k, (scan, where) in enumerate(
        navigate(navigator, with_odometry(living_room("moving", 75), WHEELS), late)
    ):
        if k == 59:
            known = set(where.landmarks.ids[where.landmarks.confirmed].tolist())
            assert len(known) >= 4
        if 60 <= k < 70:
            assert where.message is None
            assert where.state == "tracking"
            assert scan.truth is not None
            assert np.hypot(*pose_error(where, scan.truth)[:2]) < 0.1
            assert len(known & set(where.landmarks.ids.tolist())) > len(known) / 2
        if k >= 70:
            assert where.message is not None
            assert where.message.startswith("Odometry jumped by")


@pytest.mark.parametrize("broken", ["the clock stands still", "odometry jumps at each scan"])
def test_while_scans_are_left_out_less_and_less_is_claimed(broken: str) -> None:
    """From the third on the sensor may be anywhere it can drive, until it is lost and found by what it sees."""

    def damage(k: int, scan: Scan) -> Scan:
        if k < 30:
            return scan
        return replace(scan, stamp=3.0) if broken == "the clock stands still" else jumping(k, scan)

    scans = with_odometry(living_room("moving", 60), WHEELS)
    steps = [where for _, where in navigate(Navigator(LOCALIZE, MAP, START, np.eye(3) / 100), scans, damage)]
    variances = [where.estimate.covariance[0, 0] for where in steps]
    states = [where.state for where in steps]
    lost = states.index("lost")
    assert 40 < lost < 60
    assert (np.diff(variances[32 : lost + 1]) > 0).all()
    assert set(states[33:lost]) == {"coasting"}


def test_a_new_map_is_as_uncertain_as_the_pose_at_which_it_is_begun() -> None:
    """A round wall has no corners, so nothing is ever learned of the pose."""
    bearings = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    navigator, variances, messages = Navigator(SLAM), [], []
    for k in range(40):
        scan = Scan(np.full(360, 3.0), bearings, 0.1 * k)
        where = navigator.step(scan, extract(scan, EXTRACTION))
        variances.append(np.diag(where.estimate.covariance))
        messages.append(where.message or "")
    assert any("a new map was started" in message for message in messages)
    assert (np.diff(variances, axis=0) >= 0).all()


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_in_a_map_begun_anew_all_moves_and_turns_with_its_origin(heading: float) -> None:
    """Covariances against fifty thousand origins drawn from theirs."""
    rng, origin = np.random.default_rng(2), np.array([3.0, -1.0, heading])
    C = np.array([[0.5, 0.1, 0.02], [0.1, 0.8, -0.03], [0.02, -0.03, 0.01]]) / 100
    pose, local = np.array([5.0, 2.0, 0.3]), compose(inverse(origin), np.array([5.0, 2.0, 0.3]))
    drawn = np.array(
        [compose(start, local) for start in rng.multivariate_normal(origin, C, 50_000, method="cholesky")]
    )
    scan, exact = next(living_room("standing", 1)), 1e-12 * np.eye(3)
    estimate = Navigator(SLAM).step(scan, extract(scan, EXTRACTION)).estimate
    begun = MapOrigin(origin, C)
    placed = begun.estimate(replace(estimate, pose=pose, covariance=exact)).covariance
    known = begun.landmarks(Landmarks.of(Points(pose[None, :2], exact[:2, :2]))).points.covariance[0]
    scale = np.sqrt(np.outer(np.diag(placed), np.diag(placed)))
    np.testing.assert_allclose(placed / scale, np.cov(drawn.T) / scale, atol=0.03)
    np.testing.assert_allclose(known, placed[:2, :2], atol=1e-9)
