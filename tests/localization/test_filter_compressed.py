"""The compressed filter against a full invariant extended Kalman filter, written out here."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from walks import PERIOD, START_COVARIANCE, sight, true_path, walk

from lidarcore.localization import LocalizationSettings, Slam
from lidarcore.localization.ekf import joint
from lidarcore.localization.ekf.association import Association
from lidarcore.localization.ekf.estimate import Innovation
from lidarcore.localization.ekf.joint import JointState
from lidarcore.localization.ekf.passive import one_thread
from lidarcore.scan import Array, Ints

NOISE = np.array([[4e-4, 1e-4], [1e-4, 9e-4]])
GATE = 20.0


@dataclass
class Textbook:
    """[EKF 14-26] on a mean (n,) and a covariance (n, n): the pose, then the landmarks.

    Errors are e = m - R(theta) m^, theta that of the heading [Barrau and Bonnabel 2015], at the places (n,) of `told`:
    of what is in reach they are the mean, of other landmarks that at which they went out of reach.
    """

    x: Array
    P: Array

    def __post_init__(self) -> None:
        self.told = self.x.copy()

    def see(self, landmarks: Ints) -> tuple[Array, Array]:
        """Predicted positions (P, 2) in the sensor frame, and their Jacobian (2 P, n)."""
        px, py, heading = self.x[:3]
        c, s = np.cos(heading), np.sin(heading)
        z, H = [], np.zeros((2 * len(landmarks), len(self.x)))
        for k, landmark in enumerate(landmarks):
            i = 3 + 2 * landmark
            dx, dy = self.x[i] - px, self.x[i + 1] - py
            z.append([c * dx + s * dy, -s * dx + c * dy])
            H[2 * k, [0, 1, 2, i, i + 1]] = [-c, -s, -s * dx + c * dy, c, s]
            H[2 * k + 1, [0, 1, 2, i, i + 1]] = [s, -c, -c * dx - s * dy, -s, c]
        return np.array(z).reshape(-1, 2), H

    def gated(self, points: Array) -> Ints:
        """Landmarks within the gate of any point."""
        z, H = self.see(np.arange((len(self.x) - 3) // 2))
        within, P = [], self.carried(np.ones(len(self.x), np.bool_))
        for landmark, (expected, J) in enumerate(zip(z, H.reshape(-1, 2, len(self.x)), strict=True)):
            information = np.linalg.inv(J @ P @ J.T + NOISE)
            nu = points - expected
            if (np.einsum("ki,ij,kj->k", nu, information, nu) <= GATE).any():
                within.append(landmark)
        return np.array(within, np.int64)

    def predict(self, state: Array, F: Array, Q: Array) -> None:
        full = np.eye(len(self.x))
        full[:3, :3] = F
        self.x[:3] = self.told[:3] = state
        self.P = full @ self.P @ full.T
        self.P[:3, :3] += Q

    def correct(self, H: Array, innovation: Array, R: Array) -> None:
        K = self.P @ H.T @ np.linalg.inv(H @ self.P @ H.T + R)
        self.x += K @ innovation
        self.x[2] = np.angle(np.exp(1j * self.x[2]))
        J = np.eye(len(self.x)) - K @ H
        self.P = J @ self.P @ J.T + K @ R @ K.T

    def carried(self, rows: NDArray[np.bool_]) -> Array:
        """P with errors of these rows (n,) told at their mean."""
        now = np.where(rows, self.x, self.told)
        T = np.linalg.inv(to_invariant(now)) @ to_invariant(self.told)
        return T @ self.P @ T.T

    def carry(self, active: NDArray[np.bool_]) -> None:
        """Tell the errors of the pose and of active landmarks (L,) at their means."""
        rows = np.append([True] * 3, np.repeat(active, 2))
        self.P = self.carried(rows)
        self.told = np.where(rows, self.x, self.told)

    def add(self, point: Array, R: Array) -> None:
        n, (px, py, heading) = len(self.x), self.x[:3]
        c, s = np.cos(heading), np.sin(heading)
        turn = np.array([[c, -s], [s, c]])
        dx, dy = turn @ point
        G = np.zeros((2, n))
        G[:, :3] = [[1, 0, -dy], [0, 1, dx]]
        self.x = np.append(self.x, [px + dx, py + dy])
        self.told = np.append(self.told, [px + dx, py + dy])
        self.P = np.block([[self.P, self.P @ G.T], [G @ self.P, G @ self.P @ G.T + turn @ R @ turn.T]])

    def keep(self, kept: NDArray[np.bool_]) -> None:
        rows = np.append([True] * 3, np.repeat(kept, 2))
        self.x, self.told, self.P = self.x[rows], self.told[rows], self.P[np.ix_(rows, rows)]

    def fuse(self, kept: int, dropped: int, L: int) -> None:
        H = np.zeros((2, len(self.x)))
        H[:, 3 + 2 * kept : 5 + 2 * kept], H[:, 3 + 2 * dropped : 5 + 2 * dropped] = np.eye(2), -np.eye(2)
        dx, dy = H @ self.x
        H[:, 2] = dy, -dx  # as the sensor sees it: R^T (m_kept - m_dropped) = 0
        self.correct(H, np.array([-dx, -dy]), 1e-12 * np.eye(2))
        self.keep(np.arange(L) != dropped)


def to_invariant(x: Array) -> Array:
    """Jacobian (n, n) of invariant errors by those of the coordinates, at places x (n,)."""
    J = np.eye(len(x))
    for row in [0, *range(3, len(x), 2)]:
        J[row : row + 2, 2] = [x[row + 1], -x[row]]
    return J


def active(compressed: JointState) -> NDArray[np.bool_]:
    """Which landmarks (L,) are in reach."""
    return compressed._rows[compressed._slots] >= 0


def assert_equal(compressed: JointState, full: Textbook) -> None:
    L = len(compressed)
    P = full.carried(np.ones(len(full.x), np.bool_))
    own = P[3:, 3:].reshape(L, 2, L, 2)[np.arange(L), :, np.arange(L)]
    np.testing.assert_allclose(compressed.state, full.x[:3], atol=1e-9)
    np.testing.assert_allclose(compressed.landmarks.ravel(), full.x[3:], atol=1e-9)
    np.testing.assert_allclose(compressed.state_covariance, P[:3, :3], atol=1e-9)
    np.testing.assert_allclose(compressed.landmark_covariances, own, atol=1e-9)


@pytest.mark.parametrize(("most", "kept"), [(160, 20), (40, 4)])
@one_thread
def test_the_compressed_filter_is_the_full_filter(
    most: int, kept: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Through rooms that come into reach and go out of it again; landmarks are added, removed and merged on the way."""
    monkeypatch.setattr(joint, "_MOST", most)
    monkeypatch.setattr(joint, "_KEPT", kept)
    rng = np.random.default_rng(6)
    world = np.stack(np.meshgrid(np.arange(0, 36, 1.5), [-2, -0.7, 0.8, 2.2]), -1).reshape(-1, 2)
    world += rng.uniform(-0.3, 0.3, world.shape)
    names: list[int] = []  # of the landmarks, in the order of the filter
    start, P = np.array([0.0, 0.0, 0.1]), np.diag([0.01, 0.01, 0.001])
    compressed, full, truth = (
        JointState(start.copy(), P.copy()),
        Textbook(start.copy(), P.copy()),
        start.copy(),
    )
    for step in range(450):
        # There and back again, twice.
        truth[0], truth[1] = 17 * (1 - np.cos(step * 2 * np.pi / 300)), 0.3 * np.sin(step / 7)
        truth[2] = 2.0 * np.sin(step / 40)
        c, s = np.cos(truth[2]), np.sin(truth[2])
        state = truth + rng.normal(0, [0.05, 0.05, 0.01])
        F, Q = np.eye(3) + 0.05 * rng.normal(size=(3, 3)), np.diag([0.05, 0.05, 0.01]) ** 2
        compressed.predict(state, F, Q)
        full.predict(state, F, Q)
        near = np.flatnonzero(np.hypot(*(world - truth[:2]).T) < 4)
        seen = np.array([k for k in near if k in names and rng.random() < 0.7], np.int64)
        order = np.array([names.index(k) for k in seen], np.int64)
        if len(order):
            points = (world[seen] - truth[:2]) @ np.array([[c, -s], [s, c]])
            points += rng.multivariate_normal([0, 0], NOISE, len(seen), method="cholesky")
            R = np.tile(NOISE, (len(seen), 1, 1))
            near_ones = compressed.within_reach(points, R, GATE)
            assert step % 10 or set(full.gated(points)) <= set(near_ones)
            z, H = full.see(order)
            z_compressed, S = compressed.jointly_expected(order, R)
            full.carry(active(compressed))
            np.testing.assert_allclose(z_compressed, z, atol=1e-9)
            np.testing.assert_allclose(S, H @ full.P @ H.T + np.kron(np.eye(len(seen)), NOISE), atol=1e-9)
            none = np.empty((0, 2), np.int64)
            pairs = Association(np.arange(len(seen)), order, none, none, none[0:0, 0], none[0:0, 0])
            compressed.correct(Innovation(pairs, points - z_compressed, S), R)
            full.correct(H, (points - z).ravel(), np.kron(np.eye(len(seen)), NOISE))
            full.carry(active(compressed))
        new = [k for k in near.tolist() if k not in names][:3] + ([int(near[0])] if step % 37 == 5 else [])
        if new:
            points = (world[new] - truth[:2]) @ np.array([[c, -s], [s, c]])
            compressed.add(points, np.tile(NOISE, (len(new), 1, 1)))
            for point in points:
                full.add(point, NOISE)
            names += new
        twins = [(names.index(k), i) for i, k in enumerate(names) if names.index(k) < i]
        if twins and step % 11 == 0:
            first, dropped = twins[0]
            both = np.isin(np.arange(len(names)), twins[0])
            full.carry(both)
            full.fuse(first, dropped, len(names))
            compressed.fuse(first, dropped)
            full.carry(active(compressed))
            del names[dropped]
        if step % 23 == 0 and len(names) > 20:
            kept_ones = rng.random(len(names)) > 0.05
            compressed.keep(kept_ones)
            full.keep(kept_ones)
            names = [name for name, stays in zip(names, kept_ones, strict=True) if stays]
        if step % 10 == 0:
            assert_equal(compressed, full)
    assert_equal(compressed, full)


def test_slam_does_the_same_whatever_part_of_the_map_is_active(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same associations, ids and poses with four active landmarks as with all; only the cost differs."""
    poses, settings = true_path(120), LocalizationSettings()
    path = walk(np.random.default_rng(8), settings, poses, [sight(pose) for pose in poses])
    all_active = Slam(settings, poses[0], START_COVARIANCE)
    few_active = Slam(settings, poses[0], START_COVARIANCE)
    for k in range(120):
        seen, stamp, odometry = path.sightings[k], PERIOD * k, path.odometry[k]
        expected = all_active.step(seen, stamp, odometry)
        with monkeypatch.context() as patch:
            patch.setattr(joint, "_MOST", 30)
            patch.setattr(joint, "_KEPT", 4)
            few_active._joint._room = min(few_active._joint._room, 60)
            estimate = few_active.step(seen, stamp, odometry)
        np.testing.assert_array_equal(estimate.association.landmark, expected.association.landmark)
        np.testing.assert_array_equal(few_active.ids, all_active.ids)
        np.testing.assert_allclose(estimate.pose, expected.pose, atol=1e-9)
        np.testing.assert_allclose(estimate.covariance, expected.covariance, atol=1e-9)
    np.testing.assert_allclose(few_active.landmarks.xy, all_active.landmarks.xy, atol=1e-9)


@pytest.mark.long
def test_the_covariance_stays_positive_definite_over_many_changes_of_the_active_part(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(joint, "_MOST", 40)
    monkeypatch.setattr(joint, "_KEPT", 4)
    rng, world = np.random.default_rng(2), np.stack([np.arange(0, 60, 2.0), np.tile([-1.0, 1.0], 15)], -1)
    compressed, none = JointState(np.zeros(3), 1e-6 * np.eye(3)), np.empty((0, 2), np.int64)
    compressed.add(world, np.tile(NOISE, (30, 1, 1)))
    for step in range(20_000):
        middle = int(14.5 - 14.5 * np.cos(step / 300))
        order = np.arange(max(middle - 3, 0), min(middle + 4, 30))
        state = np.array([2.0 * middle, 0.0, 0.0])
        compressed.predict(compressed.state.copy(), np.eye(3), np.diag([1e-2, 1e-2, 1e-3]) ** 2)
        R = np.tile(NOISE, (len(order), 1, 1))
        z, S = compressed.jointly_expected(order, R)
        innovation = (
            world[order]
            - state[:2]
            + rng.multivariate_normal([0, 0], NOISE, len(order), method="cholesky")
            - z
        )
        pairs = Association(order, order, none, none, none[0:0, 0], none[0:0, 0])
        compressed.within_reach(z, R, GATE)
        compressed.correct(Innovation(pairs, 0.01 * innovation, S), R)
    for covariance in compressed.landmark_covariances:
        np.testing.assert_array_equal(covariance, covariance.T)
    S = compressed.jointly_expected(np.arange(30), np.zeros((30, 2, 2)))[1]
    np.testing.assert_array_equal(S, S.T)
    assert np.linalg.eigvalsh(S).min() > 0
