"""A flat world of walls, straight or uneven as they are, and where beams meet them."""

from dataclasses import dataclass, replace

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import kernel
from lidarcore.noise import SensorNoise

_STEP = 1e-3  # m between the points where a pattern is made
_FINE = 50  # such points in a correlation length, at least: between them the variance is lower by a hundredth at most


@dataclass(frozen=True, eq=False, slots=True)
class Surface:
    """How far (m) each wall's surface lies off its line, to the left of the way from its start to its end.

    An Ornstein-Uhlenbeck process along each wall: Gaussian, the covariance of two points is
    deviation² exp(-distance / length). From another bearing a beam samples it elsewhere, from the same one again.
    """

    offsets: Array
    first: Ints
    step: float

    @classmethod
    def of(cls, walls: Array, deviation: float, length: float, seed: int) -> "Surface":
        """The pattern of walls (W, 2, 2) m with a standard deviation and a correlation length (1/e), m.

        Equal walls, numbers and seeds have equal patterns; each wall has its own, whatever the others are.
        """
        step = min(_STEP, length / _FINE)
        extents = np.hypot(*(walls[:, 1] - walls[:, 0]).T)
        counts = np.ceil(extents / step).astype(np.int64) + 2
        first = np.cumsum(counts) - counts
        patterns = [
            _pattern(count, step / length, np.random.default_rng((seed, wall)))
            for wall, count in enumerate(counts.tolist())
        ]
        return cls(deviation * np.concatenate(patterns), first, step)

    def at(self, walls: Ints, along: Array) -> Array:
        """(N,) m, off the lines of walls (N,) at distances (N,) m from their starts."""
        at = along / self.step
        below = at.astype(np.int64)
        share = at - below
        index = self.first[walls] + below
        return (1 - share) * self.offsets[index] + share * self.offsets[index + 1]


@dataclass(frozen=True, eq=False, slots=True)
class World:
    """Walls (W, 2, 2): start and end points, m, world frame; straight ones without a surface."""

    walls: Array
    surface: Surface | None = None

    def uneven(self, noise: SensorNoise, seed: int) -> "World":
        """This world with walls as uneven as the noise says; unchanged if it says nothing of unevenness."""
        if not noise.unevenness:
            return self
        surface = Surface.of(self.walls, noise.unevenness, noise.unevenness_length, seed)
        return replace(self, surface=surface)

    def cast(self, pose: Array, bearings: Array) -> tuple[Array, Ints]:
        """True ranges (N,) m, NaN where no wall is met, and the wall each beam meets (N,), -1 for none.

        pose (3,), or (N, 3) if the sensor moves from beam to beam: T_world_sensor as x m, y m, heading rad;
        bearings (N,) rad in the sensor frame.
        """
        ranges, hit = np.empty(len(bearings)), np.empty(len(bearings), np.int64)
        x, y, heading = np.broadcast_to(pose, (len(bearings), 3)).T.copy()
        directions = bearings + heading
        _cast(self.walls, x, y, directions, ranges, hit)
        if self.surface is not None:
            seen = hit >= 0
            ranges[seen] += self._farther(
                self.surface, hit[seen], x[seen], y[seen], directions[seen], ranges[seen]
            )
        return ranges, hit

    def _farther(
        self, surface: Surface, hit: Ints, x: Array, y: Array, directions: Array, ranges: Array
    ) -> Array:
        """How much farther (N,) m beams go where they meet the surface instead of the line, to first order."""
        start, along = self.walls[hit, 0], self.walls[hit, 1] - self.walls[hit, 0]
        along = along / np.hypot(along[:, 0], along[:, 1])[:, None]
        ux, uy = np.cos(directions), np.sin(directions)
        share = (x + ranges * ux - start[:, 0]) * along[:, 0] + (y + ranges * uy - start[:, 1]) * along[:, 1]
        outwards = along[:, 0] * uy - along[:, 1] * ux  # cosine of the angle to the normal on the left
        return surface.at(hit, np.maximum(share, 0.0)) / outwards

    def clearance(self, x: float, y: float) -> float:
        """Distance (m) from a point to the nearest wall."""
        start, along = self.walls[:, 0], self.walls[:, 1] - self.walls[:, 0]
        to_point = np.array([x, y]) - start
        share = np.clip((to_point * along).sum(1) / (along**2).sum(1), 0, 1)
        return float(np.linalg.norm(to_point - share[:, None] * along, axis=1).min())


@kernel
def _cast(walls: Array, x: Array, y: Array, directions: Array, ranges: Array, hit: Ints) -> None:
    for i in range(len(directions)):
        ux, uy = np.cos(directions[i]), np.sin(directions[i])
        nearest, wall = np.inf, -1
        for k in range(len(walls)):
            ax, ay = walls[k, 0, 0] - x[i], walls[k, 0, 1] - y[i]
            dx, dy = walls[k, 1, 0] - walls[k, 0, 0], walls[k, 1, 1] - walls[k, 0, 1]
            det = dx * uy - dy * ux
            if det == 0:
                continue
            distance, share = (dx * ay - dy * ax) / det, (ux * ay - uy * ax) / det
            if 0 < distance < nearest and 0 <= share <= 1:
                nearest, wall = distance, k
        ranges[i], hit[i] = nearest if wall >= 0 else np.nan, wall


def _pattern(count: int, step: float, rng: np.random.Generator) -> Array:
    """(count,) of an Ornstein-Uhlenbeck process of unit variance, at points `step` correlation lengths apart."""
    from scipy.signal import lfilter  # here: importing it takes a second

    kept = np.exp(-step)
    steps = np.sqrt(1 - kept**2) * rng.normal(size=count)
    steps[0] = rng.normal()
    return lfilter([1.0], [1.0, -kept], steps)
