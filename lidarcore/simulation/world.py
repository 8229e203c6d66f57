"""A flat world of walls, and where beams meet them."""

from dataclasses import dataclass, replace

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.compiled import kernel
from lidarcore.noise import SensorNoise
from lidarcore.simulation.surface import Surface


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
