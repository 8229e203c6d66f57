"""A flat world of straight walls, and where beams meet them."""

from dataclasses import dataclass

import numpy as np

from lidarcore.compiled import kernel
from lidarcore.scan import Array, Ints


@dataclass(frozen=True, eq=False, slots=True)
class World:
    """Walls (W, 2, 2): start and end points, m, world frame."""

    walls: Array

    def cast(self, pose: Array, bearings: Array) -> tuple[Array, Ints]:
        """True ranges (N,) m, NaN where no wall is met, and the wall each beam meets (N,), -1 for none.

        pose (3,), or (N, 3) if the sensor moves from beam to beam: T_world_sensor as x m, y m, heading rad;
        bearings (N,) rad in the sensor frame.
        """
        ranges, hit = np.empty(len(bearings)), np.empty(len(bearings), np.int64)
        x, y, heading = np.broadcast_to(pose, (len(bearings), 3)).T.copy()
        _cast(self.walls, x, y, bearings + heading, ranges, hit)
        return ranges, hit

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
