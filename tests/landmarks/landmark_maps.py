"""Random landmarks as arrays, so that truth can be computed without the database."""

import numpy as np

from lidarcore.landmarks import Landmark


class RandomLandmarks:
    """N landmarks: some in the open, some crowded, some on one spot, from 2 mm to 2 m uncertain."""

    def __init__(self, n, seed=0):
        rng = np.random.default_rng(seed)
        self.ids = np.arange(1, n + 1)
        crowded = rng.uniform(size=n) < 0.5
        self.xy = np.where(crowded[:, None], rng.normal((30, 40), 4, (n, 2)), rng.uniform(-50, 250, (n, 2)))
        self.xy[:20] = self.xy[0]
        sigma, angle = 10 ** rng.uniform(-2.7, 0.3, (n, 2)), rng.uniform(0, np.pi, n)
        c, s = np.cos(angle), np.sin(angle)
        rotation = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
        self.covariance = rotation @ (sigma[:, :, None] ** 2 * np.eye(2)) @ rotation.transpose(0, 2, 1)
        self.sigma = sigma.max(1)
        self.kind = np.where(rng.uniform(size=n) < 0.3, "cluster", "corner")
        self.method = np.where(self.kind == "cluster", "dbscan", "ml")
        self.count = rng.integers(1, 100, n)
        self.first_seen = rng.uniform(0, 1e5, n)
        self.last_seen = self.first_seen + rng.exponential(1000, n)

    def landmarks(self):
        for i in range(len(self.ids)):
            yield Landmark.of(
                self.xy[i], self.covariance[i], str(self.kind[i]), method=str(self.method[i]),
                count=self.count[i], first_seen=self.first_seen[i], last_seen=self.last_seen[i],
            )  # fmt: skip


def corner(x=1.0, y=2.0, **fields):
    """A landmark that is good where nothing else is said."""
    defaults = {"var_x": 1e-4, "cov_xy": 2e-5, "var_y": 4e-4, "kind": "corner"}
    return Landmark(x, y, **(defaults | fields))
