"""A large map of landmarks, and how fast it ought to answer."""

from collections.abc import Iterator

import numpy as np

from lidarcore.landmarks import Landmark

DENSITY = 1.0  # landmarks per m²
LIMIT_MS = 10.0


def random_landmarks(n: int, side: float, rng: np.random.Generator) -> Iterator[Landmark]:
    """Landmarks all over a square of this side (m), standard deviations from 3 mm to 0.3 m."""
    xy, sigma = rng.uniform(0, side, (n, 2)), 10 ** rng.uniform(-2.5, -0.5, (n, 2))
    for (x, y), (a, b), rho in zip(
        xy.tolist(), sigma.tolist(), rng.uniform(-0.9, 0.9, n).tolist(), strict=True
    ):
        yield Landmark(x, y, a * a, rho * a * b, b * b, "corner" if rho > 0 else "cluster", "ml", 1)
