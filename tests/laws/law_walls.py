"""Walls with known truth, drawn by Hypothesis or named, and what the laws measure with."""

from dataclasses import dataclass, replace

import numpy as np
from hypothesis import strategies as st

from lidarcore import SensorNoise

EPS = np.finfo(float).eps


@dataclass(frozen=True)
class Wall:
    """The line with normal direction alpha at distance r, met by beams at angles `incidence` from its normal."""

    alpha: float
    r: float
    incidence: np.ndarray

    @property
    def bearings(self) -> np.ndarray:
        return self.alpha + self.incidence

    @property
    def ranges(self) -> np.ndarray:
        return self.r / np.cos(self.incidence)

    @property
    def along(self) -> np.ndarray:
        """Coordinate of each point along the wall."""
        return self.r * np.tan(self.incidence)

    @property
    def conditioning(self) -> float:
        """How rounding of the coordinates (relative, EPS) comes back in alpha and in r / range."""
        reach = self.ranges.max()
        return reach / np.ptp(self.along) * reach / self.r

    def turned(self, angle: float) -> "Wall":
        return replace(self, alpha=self.alpha + angle)

    def measured(self, noise: SensorNoise, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Noisy ranges and bearings of the wall."""
        n = len(self.incidence)
        return (
            self.ranges + rng.normal(0, noise.sigma_range, n),
            self.bearings + rng.normal(0, noise.sigma_bearing, n),
        )


@st.composite
def walls(draw, nearest: float = 0.05, farthest: float = 1000, least_points: int = 2) -> Wall:
    """Any wall: all around the sensor, near and far, seen squarely or at a grazing angle, whole or a sliver."""
    n = draw(st.integers(least_points, 40))
    width = draw(st.floats(np.radians(1), np.radians(120)))
    middle = draw(st.floats(-1, 1)) * (np.radians(86) - width / 2)
    jitter = draw(st.floats(0, 0.4)) * np.sin(np.pi * np.linspace(0, 1, n) * n) / n  # uneven, ends stay
    return Wall(
        draw(st.floats(-np.pi, np.pi)),
        draw(st.floats(nearest, farthest)),
        middle + width * (np.linspace(-0.5, 0.5, n) + jitter),
    )


noises = st.builds(SensorNoise, st.floats(1e-4, 0.1), st.floats(1e-5, 0.02))


@st.composite
def measured_walls(draw, least_points: int = 3):
    """(wall, ranges, bearings, noise): a wall measured with noise small against it, range or bearing dominating."""
    wall = draw(walls(farthest=50, least_points=least_points))
    share = st.floats(-4, -1.7).map(lambda e: 10**e / wall.conditioning)
    noise = SensorNoise(min(draw(share) * wall.r, 1.0), draw(share))
    return wall, *wall.measured(noise, np.random.default_rng(draw(st.integers(0, 2**32 - 1)))), noise


# Walls of a room: square on, to the side, far down a corridor, behind, close by.
ROOM_WALLS = [
    Wall(0.3, 2.0, np.linspace(-0.6, 0.5, 60)),
    Wall(2.2, 3.0, np.linspace(0.2, 1.0, 45)),
    Wall(-2.8, 1.2, np.linspace(-1.25, -0.5, 70)),
    Wall(-0.9, 8.0, np.linspace(-0.1, 0.3, 30)),
    Wall(np.pi, 0.6, np.linspace(-1.0, 1.1, 90)),
]


def angle_between(a: float, b: float) -> float:
    """Difference of two directions, in [-pi, pi]."""
    return float(np.angle(np.exp(1j * (a - b))))


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    """Largest deviation of a covariance, each entry in units of the standard deviations it belongs to."""
    sigma = np.sqrt(np.diag(expected))
    return float(np.abs((found - expected) / np.outer(sigma, sigma)).max())


def assert_positive_definite(covariance: np.ndarray) -> None:
    assert np.isfinite(covariance).all()
    assert covariance[0, 1] == covariance[1, 0]
    assert covariance[0, 0] > 0
    assert covariance[1, 1] > 0
    assert abs(covariance[0, 1]) < np.sqrt(covariance[0, 0] * covariance[1, 1])
