"""The joint Gaussian of SLAM: the motion state first, then two coordinates for each landmark."""

import numpy as np

from lidarcore.localization.kalman import Innovation, block_diagonal, correction
from lidarcore.localization.measurement import to_sensor, to_world
from lidarcore.poses import wrap
from lidarcore.scan import Array, Ints


class JointState:
    """Mean (n,) and covariance (n, n) of a motion state (d,) and L landmarks, n = d + 2 L."""

    def __init__(self, state: Array, P: Array) -> None:
        self._x, self._P, self._d = state, P, len(state)

    def __len__(self) -> int:
        return (len(self._x) - self._d) // 2

    @property
    def state(self) -> Array:
        """(d,) of the motion."""
        return self._x[: self._d]

    @property
    def state_covariance(self) -> Array:
        """(d, d)."""
        return self._P[: self._d, : self._d]

    @property
    def landmarks(self) -> Array:
        """(L, 2) m, world frame."""
        return self._x[self._d :].reshape(-1, 2)

    @property
    def landmark_covariances(self) -> Array:
        """(L, 2, 2) m²."""
        L = len(self)
        blocks: Array = self._P[self._d :, self._d :].reshape(L, 2, L, 2)[np.arange(L), :, np.arange(L)]
        return blocks

    def predict(self, state: Array, F: Array, Q: Array) -> None:
        """Put the motion state (d,) in place of the old one; F (d, d) is its Jacobian, Q (d, d) the noise."""
        d, P = self._d, self._P
        self._x[:d] = state
        P[:d] = F @ P[:d]
        P[d:, :d] = P[:d, d:].T
        P[:d, :d] = P[:d, :d] @ F.T + Q

    def expected(self) -> tuple[Array, Array]:
        """Where all landmarks appear in the sensor frame (L, 2), and how uncertain that is (L, 2, 2)."""
        z, H, R = to_sensor(self.state[:3], self.landmarks)
        cross = self._P[:3, self._d :].reshape(3, -1, 2).transpose(1, 0, 2)
        mixed = H @ cross @ R.T
        return z, (
            H @ self._P[:3, :3] @ H.transpose(0, 2, 1)
            + mixed
            + mixed.transpose(0, 2, 1)
            + R @ self.landmark_covariances @ R.T
        )

    def gains(self, landmarks: Ints, noise: Array) -> tuple[Array, Array]:
        """P H^T (n, 2 P) for the landmarks (P,), and S (2 P, 2 P) with the noise (P, 2, 2) of their observations."""
        _, H_pose, R = to_sensor(self.state[:3], self.landmarks[landmarks])
        columns = self._d + 2 * landmarks[:, None] + [0, 1]
        by_pose = self._P[:, :3] @ H_pose.reshape(-1, 3).T
        PHt = by_pose + (self._P[:, columns] @ R.T).reshape(by_pose.shape)
        HPHt = H_pose.reshape(-1, 3) @ PHt[:3]
        HPHt += (R @ PHt[columns]).reshape(HPHt.shape)
        return PHt, (HPHt + HPHt.T) / 2 + block_diagonal(noise)

    def correct(self, PHt: Array, innovation: Innovation) -> None:
        """Add what the innovation tells, given P H^T (n, 2 P) of its pairs."""
        change, W = correction(PHt, innovation)
        self._x += change
        self._x[2] = wrap(self._x[2])
        self._P -= W @ W.T

    def add(self, points: Array, covariances: Array) -> None:
        """Append landmarks seen at points (K, 2) m with covariances (K, 2, 2), sensor frame."""
        m, G_pose, R = to_world(self.state[:3], points)
        G = G_pose.reshape(-1, 3)
        cross = G @ self._P[:3]
        own = cross[:, :3] @ G.T + block_diagonal(R @ covariances @ R.T)
        self._x = np.concatenate([self._x, m.ravel()])
        self._P = np.block([[self._P, cross.T], [cross, own]])

    def keep(self, kept: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> None:
        """Forget the landmarks that are not in kept (L,)."""
        rows = np.concatenate([np.ones(self._d, np.bool_), np.repeat(kept, 2)])
        self._x, self._P = self._x[rows], self._P[np.ix_(rows, rows)]
