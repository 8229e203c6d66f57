"""Places in a room from which corners are seen, and what is true there."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.evaluation.consistency.cramer_rao import bound_corners
from lidarcore.geometry import unit_vectors
from lidarcore.noise import SensorNoise
from lidarcore.simulation import random_pose
from lidarcore.simulation.world import World

MIN_BEAMS, MIN_EXTENT = 8, 0.4  # a stretch of wall counts as seen from this many beams and metres on
CLEARANCE = 0.4  # m, of the sensor from every wall


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """One true scan and the P corners in it, sensor frame.

    ranges (N,) m and bearings (N,) rad without noise, hit (N,) the wall each beam meets, -1 for none;
    first, count (P, 2) the beams of the two walls of each corner, which do not wrap, and walls (P, 2) their numbers;
    corners (P, 2) m; bounds (P, 2, 2) m², the Cramér-Rao bound of each.
    """

    ranges: Array
    bearings: Array
    hit: Ints
    first: Ints
    count: Ints
    walls: Ints
    corners: Array
    bounds: Array

    def upto(self, n: int) -> "Place":
        """This place with its first n corners only."""
        return replace(
            self,
            first=self.first[:n],
            count=self.count[:n],
            walls=self.walls[:n],
            corners=self.corners[:n],
            bounds=self.bounds[:n],
        )


def places(world: World, noise: SensorNoise, beams: int, rng: np.random.Generator) -> Iterator[Place]:
    """Random places without end, the first beam at a random angle in each; those that see no corner are left out."""
    joints = shared_ends(world)
    while True:
        place = look(world, joints, random_pose(world, rng, CLEARANCE), noise, beams, float(rng.uniform()))
        if len(place.corners):
            yield place


def shared_ends(world: World) -> Array:
    """(W, W, 2) m, world frame: the end that two walls have in common, NaN if there is none."""
    ends = world.walls
    same = (np.abs(ends[:, None, :, None] - ends[None, :, None, :]) < 1e-9).all(-1)  # (W, W, 2, 2)
    joints = np.full((len(ends), len(ends), 2), np.nan)
    for a, b, i, _ in np.argwhere(same):
        if a != b:
            joints[a, b] = ends[a, i]
    return joints


def look(world: World, joints: Array, pose: Array, noise: SensorNoise, beams: int, phase: float) -> Place:
    """The place at a pose (x m, y m, heading rad), the first beam `phase` increments after straight behind.

    A corner is seen where two stretches of wall follow each other and the end they share lies between them.
    """
    ranges, bearings, hit = _from_a_start(world, pose, 2 * np.pi * (np.arange(beams) + phase) / beams - np.pi)
    first = np.flatnonzero(hit != np.roll(hit, 1))
    count = np.diff(first, append=beams)
    last, wall = first + count - 1, hit[first]
    u = unit_vectors(bearings)
    points = ranges[:, None] * u
    long_enough = np.linalg.norm(points[last] - points[first], axis=1) >= MIN_EXTENT
    seen = (wall >= 0) & (count >= MIN_BEAMS) & long_enough
    after = np.roll(np.arange(len(first)), -1)
    turn = np.exp(-1j * pose[2])
    corners = _turned(joints[wall, wall[after]] - pose[:2], turn)
    between = (_cross(u[last], corners) >= 0) & (_cross(corners, u[first[after]]) >= 0)  # NaN is not
    j = np.flatnonzero(seen & seen[after] & between)
    pairs = np.column_stack([j, after[j]])
    lines = _lines(_turned(world.walls[:, 1] - world.walls[:, 0], turn)[wall], points[first])
    bounds = np.empty((len(j), 2, 2))
    variances = noise.sigma_range**2, noise.sigma_bearing**2
    bound_corners(bearings, first[pairs], count[pairs], lines[pairs], *variances, bounds)
    return Place(ranges, bearings, hit, first[pairs], count[pairs], wall[pairs], corners[j], bounds)


def _from_a_start(world: World, pose: Array, bearings: Array) -> tuple[Array, Array, Ints]:
    """True ranges, bearings and walls met, turned so that no stretch of one wall wraps."""
    ranges, hit = world.cast(pose, bearings)
    start = int(np.argmax(hit != np.roll(hit, 1)))
    return np.roll(ranges, -start), np.roll(bearings, -start), np.roll(hit, -start)


def _turned(xy: Array, turn: complex) -> Array:
    return (np.ascontiguousarray(xy).view(complex) * turn).view(float)


def _cross(a: Array, b: Array) -> Array:
    """(M,) positive where b is less than half a turn counter-clockwise of a, (M, 2) each."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _lines(along: Array, points: Array) -> Array:
    """Unit normal and distance (M, 3) of walls along (M, 2) through points (M, 2), away from the sensor."""
    tangent = along / np.linalg.norm(along, axis=1, keepdims=True)
    normal = tangent[:, ::-1] * [1, -1]
    r = (normal * points).sum(1)
    return np.column_stack([normal, r]) * np.where(r < 0, -1.0, 1.0)[:, None]
