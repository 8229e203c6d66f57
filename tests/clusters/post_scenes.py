"""Posts on open ground with known truth, and what the tests of clusters measure with."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lidarcore import Scan, SensorNoise

NOISE = SensorNoise(0.01, 0.001)
FRONT, AROUND = 463, 926  # beams over half a turn and over a whole one


@dataclass(frozen=True)
class Posts:
    """Round posts: centres (P, 2) m in the sensor frame, and one radius, m."""

    centres: np.ndarray
    radius: float = 0.15

    def cast(self, bearings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """True range of each beam, NaN for none, and the post it meets, -1 for none."""
        u = np.stack([np.cos(bearings), np.sin(bearings)], -1)
        along = u @ self.centres.T
        aside = u[:, :1] * self.centres[:, 1] - u[:, 1:] * self.centres[:, 0]
        met = (np.abs(aside) < self.radius) & (along > 0)
        ranges = np.where(met, along - np.sqrt(np.maximum(self.radius**2 - aside**2, 0)), np.inf)
        nearest = ranges.min(axis=1)
        return np.where(nearest < np.inf, nearest, np.nan), np.where(
            met.any(axis=1), ranges.argmin(axis=1), -1
        )

    def scan(
        self, bearings: np.ndarray, rng: np.random.Generator, noise: SensorNoise = NOISE
    ) -> tuple[Scan, np.ndarray]:
        """A noisy scan, and the post each beam meets."""
        ranges, post = self.cast(bearings)
        n = len(bearings)
        ranges, bearings = (
            ranges + rng.normal(0, noise.sigma_range, n),
            bearings + rng.normal(0, noise.sigma_bearing, n),
        )
        order = np.argsort(bearings)
        return Scan(ranges[order], bearings[order]), post[order]


def front() -> np.ndarray:
    """Bearings of a sensor that looks ahead over half a turn."""
    return np.linspace(-np.pi / 2, np.pi / 2, FRONT)


def around() -> np.ndarray:
    """Bearings of a sensor that looks all around."""
    return np.linspace(-np.pi, np.pi, AROUND, endpoint=False)


def posts_ahead(number: int, rng: np.random.Generator, apart: float = 1.0, reach: float = 7.0) -> Posts:
    """Posts within reach (m) ahead of the sensor, all in full view and `apart` (m) from each other."""
    centres: list[np.ndarray] = []
    while len(centres) < number:
        r, angle = reach * np.sqrt(rng.uniform(0.05, 1)), rng.uniform(-1.4, 1.4)
        centre = r * np.array([np.cos(angle), np.sin(angle)])
        hidden = any(abs(np.arctan2(*(c[::-1])) - angle) < 0.2 + 0.2 / min(r, np.hypot(*c)) for c in centres)
        if not hidden and all(np.hypot(*(centre - c)) > apart for c in centres):
            centres.append(centre)
    return Posts(np.array(centres))


def scenes(count: int, number: int, seed: int) -> Iterator[tuple[Scan, np.ndarray]]:
    """Scans of as many random scenes of so many posts, and the post each beam meets."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield posts_ahead(number, rng).scan(front(), rng)


def same_partition(a: np.ndarray, b: np.ndarray) -> bool:
    """True if two labelings say the same under other names; -1 is -1 in both."""
    pairs = np.unique(np.stack([a, b]), axis=1)
    one_to_one = len(pairs.T) == len(np.unique(a)) == len(np.unique(b))
    return bool(one_to_one and ((pairs[0] == -1) == (pairs[1] == -1)).all())


def rolled(scan: Scan, k: int) -> Scan:
    """The same scan, its ring started k beams later."""
    return Scan(np.roll(scan.ranges, -k), np.roll(scan.bearings, -k))


def turned(scan: Scan, angle: float) -> Scan:
    """The scan of a sensor turned clockwise by angle (rad), so that all it sees turns counter-clockwise."""
    return Scan(scan.ranges, scan.bearings + angle)
