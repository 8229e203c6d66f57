"""People who walk about a room: what a lidar at the height of their shins sees are two legs each."""

import numpy as np
from scipy.spatial import KDTree

from lidarcore.arrays import Array
from lidarcore.errors import SimulationError
from lidarcore.geometry import left_of
from lidarcore.simulation.rooms import random_pose
from lidarcore.simulation.world import World

LEG = 0.065  # m, radius of a leg in trousers

_HIP = 0.1  # m from the middle to either leg
_SWING = 0.25  # m that a foot is ahead of or behind the middle at most
_STRIDE = 1.4  # m, two steps
_WALL = 0.35  # m between the middle and a wall, at least
_SENSOR = 0.6  # m between the middle and where the sensor is at any time
_SPEED = (1.1, 0.15)  # m/s, mean and standard deviation from walk to walk
_SHORT = 1.0  # m, shortest walk
_REST = 4.0  # s that someone stands before walking on, at most
_TRIES = 2000


class Person:
    """Someone who walks straight from one spot of a world to another, stands a little, and walks on.

    avoid (P, 2) m, world frame: points to keep clear of, such as the path of the sensor.
    """

    def __init__(self, world: World, rng: np.random.Generator, avoid: Array) -> None:
        self._world, self._rng, self._avoid = world, rng, KDTree(avoid)
        spot = self._next_spot(None)
        # The route: when it bends (s), where (x, y m), how far it was (m), and the direction from there on.
        self._route = np.array([[0.0, *spot, 0.0, 1.0, 0.0]])

    def legs(self, times: Array) -> Array:
        """Centres of both legs, (2, N, 2) m, world frame, at growing times (N,) s; only the present is remembered."""
        while times[-1] >= self._route[-1, 0]:
            self._walk_on()
        passed = np.maximum(np.searchsorted(self._route[:, 0], times, "right") - 1, 0)
        self._route, passed = self._route[passed[0] :], passed - passed[0]
        x, y, walked = (np.interp(times, self._route[:, 0], column) for column in self._route.T[1:4])
        middle, ahead = np.stack([x, y], -1), self._route[passed, 4:]
        left = left_of(ahead)
        swing = _SWING * np.sin(2 * np.pi * walked / _STRIDE)[:, None] * ahead
        return np.stack([middle + _HIP * left + swing, middle - _HIP * left - swing])

    def _walk_on(self) -> None:
        """Add a rest and a walk to the route."""
        time, *here, walked = self._route[-1, :4]
        spot, speed = self._next_spot(np.array(here)), max(self._rng.normal(*_SPEED), 0.5)
        distance = float(np.hypot(*(spot - here)))
        leave = time + self._rng.uniform(0, _REST)
        ahead = (spot - here) / distance
        bends = [[leave, *here, walked, *ahead], [leave + distance / speed, *spot, walked + distance, *ahead]]
        self._route = np.concatenate([self._route, bends])

    def _next_spot(self, here: Array | None) -> Array:
        """A random spot with a clear way to it; any clear spot to begin with."""
        for _ in range(_TRIES):
            spot = random_pose(self._world, self._rng, _WALL)[:2]
            start = spot if here is None else here
            if (here is None or np.hypot(*(spot - start)) > _SHORT) and self._is_clear(start, spot):
                return spot
        raise SimulationError("Nobody can walk here: walls and the sensor's path leave too little room.")

    def _is_clear(self, start: Array, end: Array) -> bool:
        x, y = end - start
        free, _ = self._world.cast(np.append(start, 0.0), np.arctan2([y], [x]))
        if free[0] < np.hypot(x, y):  # most spots of a large building lie behind walls
            return False
        steps = int(np.hypot(x, y) / 0.1) + 1
        way = start + np.linspace(0, 1, steps + 1)[:, None] * (end - start)
        return bool(self._avoid.query(way)[0].min() >= _SENSOR) and all(
            self._world.clearance(*at) >= _WALL for at in way
        )
