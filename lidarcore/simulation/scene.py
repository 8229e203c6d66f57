"""A room that lives: people walk, the sensor moves, and every beam has a time of its own."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array
from lidarcore.noise import SensorNoise
from lidarcore.simulation.paths import Path
from lidarcore.simulation.people import LEG, Person
from lidarcore.simulation.posts import Posts, distances_to_circles
from lidarcore.simulation.world import World

_ONE_LINE = 0.01  # m: two beams whose walls' lines pass the sensor at distances this alike meet the same wall


@dataclass(frozen=True, slots=True)
class Scene:
    """Walls and posts, who walks between them, and where the sensor is."""

    world: World
    path: Path
    people: Sequence[Person] = ()
    posts: Posts | None = None

    def cast(self, times: Array, bearings: Array) -> tuple[Array, Array]:
        """True ranges (N,) m, NaN for none, of beams at growing times (N,) s and bearings (N,) rad, sensor frame.

        Beside them the sine (N,) of the angle at which each beam meets its wall; 1 for what is round.
        """
        poses = self.path(times)
        ranges, hit = self.world.cast(poses, bearings)
        directions = np.exp(1j * (bearings + poses[:, 2])).view(float).reshape(-1, 2)
        sines = _sines(self.world.walls[hit], directions)
        distances = self._to_round(times, poses[:, :2], directions)
        nearer = distances < np.where(np.isnan(ranges), np.inf, ranges)
        ranges, sines = np.where(nearer, distances, ranges), np.where(nearer, 1.0, sines)
        return ranges, sines

    def _to_round(self, times: Array, positions: Array, directions: Array) -> Array:
        """Distance (N,) m to the nearest leg or post, inf for none."""
        distances = np.full(len(times), np.inf)
        if self.people:
            legs = np.concatenate([person.legs(times) for person in self.people])
            distances = distances_to_circles(legs, LEG, positions, directions)
        if self.posts is not None:
            distances = np.minimum(distances, self.posts.distances(positions, directions))
        return distances


@dataclass(frozen=True, slots=True)
class Optics:
    """What a sensor makes of true ranges.

    mixed      share of the beams at a step in range from one surface to another that meet both sides: they report
               something in between
    dropouts   share of all beams that are lost for no reason in particular
    grazing    sine of the angle to the wall below which nothing comes back
    limits     m, nearest and farthest range that is reported
    """

    noise: SensorNoise
    mixed: float = 0.5
    dropouts: float = 0.003
    grazing: float = 0.03
    limits: tuple[float, float] = (0.1, 40.0)
    step: float = 0.15  # m between neighbours from which on a beam can be mixed

    def observe(self, ranges: Array, sines: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """Reported ranges (N,) m, NaN for no return, and quality (N,), 0 to 63, of neighbouring beams."""
        sigmas = np.sqrt(self.noise.range_variances(ranges))
        seen = self._mix(ranges, sines, rng) + sigmas * rng.normal(size=len(ranges))
        low, high = self.limits
        lost = (rng.random(len(ranges)) < self.dropouts) | (sines < self.grazing)
        seen = np.where(lost | ~((seen >= low) & (seen <= high)), np.nan, seen)
        quality = np.clip(np.rint((60 - 1.5 * seen) * np.sqrt(sines)), 5, 63)
        return seen, np.where(np.isnan(seen), 0.0, quality)

    def _mix(self, ranges: Array, sines: Array, rng: np.random.Generator) -> Array:
        """Where range jumps from one surface to the next, some beams lie anywhere between both sides.

        Along a wall that is seen at a slant ranges grow in steps, too, but its line stays as far away.
        """
        lines = ranges * sines
        step, apart = (np.diff(values, append=values[-1:]) for values in (ranges, lines))
        edges = (np.abs(step) > self.step) & (np.abs(apart) > _ONE_LINE)
        mixed = edges & (rng.random(len(ranges)) < self.mixed)
        return ranges + np.where(mixed, step * rng.random(len(ranges)), 0.0)


def _sines(walls: Array, directions: Array) -> Array:
    """Sine (N,) of the angle between each wall (N, 2, 2) and unit vector (N, 2)."""
    along = walls[:, 1] - walls[:, 0]
    across = along[:, 0] * directions[:, 1] - along[:, 1] * directions[:, 0]
    return np.abs(across) / np.hypot(along[:, 0], along[:, 1])
