"""How true walls are: against simulated rooms, where truth is known, and against the grid, where it is not."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.evaluation.maps.accuracy import reference_poses
from lidarcore.geometry import squared_mahalanobis, wrap
from lidarcore.mapping.grid.builder import build_grid
from lidarcore.mapping.grid.occupancy import OccupancyGrid
from lidarcore.mapping.walls.spread import joint_spread
from lidarcore.mapping.walls.walls import Walls, find_walls
from lidarcore.noise import SensorNoise
from lidarcore.scan import Scan
from lidarcore.settings import ExtractionSettings
from lidarcore.simulation import SimulatedSensor, World
from lidarcore.simulation.worlds import place, way

ROOMS = ("furnished room", "two rooms", "corridor")
_NOISE = SensorNoise(0.01, 0.001)
_KEYFRAMES = 60
_DRIFT = (
    np.diag([0.015, 0.015, 0.003]) ** 2
)  # of a keyframe's pose, alike over ten of them, a twentieth its own
_REFERENCE = (0.02, 0.02, 0.005)  # m, m, rad that corrected poses of a log are off by
_LONG = 1.0  # m: shorter walls are not asked for
_NEAR = 0.12  # m from a true wall, within which one that was found is taken for it
_SEEN = 3  # keyframes from which half of a wall is in view, at least, for it to be asked for


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """How walls compare with the T true ones that are longer than a metre and were in view.

    times      (T,) how often each was found
    line_chi2  (F,) squared Mahalanobis distance of (alpha, r) from truth, two degrees of freedom
    length_z   (E,) error of the length over its standard deviation, where both ends were seen
    """

    times: Ints
    line_chi2: Array
    length_z: Array


def wall_rooms(seeds: int) -> Iterator[tuple[World, Walls, Array]]:
    """Simulated rooms, their walls as they were mapped, and the true poses (K, 3): every room with so many seeds."""
    for name in ROOMS:
        for seed in range(seeds):
            yield _mapped(name, np.random.default_rng(seed))


def _mapped(name: str, rng: np.random.Generator) -> tuple[World, Walls, Array]:
    where = place(name)
    path = where.path()
    duration = len(way(path)) * 0.25
    true = path(np.linspace(0, duration, _KEYFRAMES, endpoint=False) + rng.uniform(0, 1))
    sensor = SimulatedSensor(where.world, _NOISE)
    scans = [sensor.scan(pose, rng, float(k))[0] for k, pose in enumerate(true)]
    k = np.arange(_KEYFRAMES)
    alike = np.exp(-np.abs(k[:, None] - k) / 10.0) + 0.05 * np.eye(_KEYFRAMES)
    covariance = np.kron(alike, _DRIFT)
    errors = rng.multivariate_normal(np.zeros(3 * _KEYFRAMES), covariance, method="cholesky").reshape(-1, 3)
    poses = true + errors
    extraction = ExtractionSettings(noise=_NOISE)
    grid = build_grid(scans, poses)
    walls = find_walls(scans, poses, joint_spread(covariance), grid, extraction=extraction)
    return where.world, walls, true


def compare_with_truth(world: World, walls: Walls, poses: Array) -> Found:
    """The walls that keyframes at true poses (K, 3) led to, compared with the world's."""
    times, chi2, z = [], [], []
    for true in world.walls:
        length = float(np.hypot(*(true[1] - true[0])))
        if length < _LONG or _views(world, true, poses) < _SEEN:
            continue
        same = _same(walls, true, length)
        times.append(len(same))
        if len(same):
            best = int(same[np.argmax(walls.length[same])])
            chi2.append(_line_chi2(walls, best, true))
            if walls.ended[best].all():
                z.append((walls.length[best] - length) / np.sqrt(walls.length_variance[best]))
    return Found(np.array(times, np.int64), np.array(chi2), np.array(z))


def _same(walls: Walls, true: Array, length: float) -> Ints:
    along = (true[1] - true[0]) / length
    t = (walls.ends - true[0]) @ along
    beside = (walls.ends - true[0]) @ [-along[1], along[0]]
    shared = np.minimum(t.max(axis=1), length) - np.maximum(t.min(axis=1), 0)
    near = np.abs(beside).max(axis=1) < _NEAR
    return np.flatnonzero(near & (shared > 0.3 * np.minimum(length, walls.length)))


def _line_chi2(walls: Walls, i: int, true: Array) -> float:
    along = (true[1] - true[0]) / np.hypot(*(true[1] - true[0]))
    alpha, r = np.arctan2(along[0], -along[1]), float(true[0] @ [-along[1], along[0]])
    turn = float(wrap(walls.alpha[i] - alpha))
    if abs(turn) > np.pi / 2:
        turn, r = float(wrap(turn + np.pi)), -r
    e = np.array([turn, walls.r[i] - r])
    return float(squared_mahalanobis(e, walls.line_covariance[i]))


def _views(world: World, wall: Array, poses: Array) -> int:
    """Number of poses from which at least half of a wall is in view, and not at too grazing an angle."""
    points = wall[0] + np.linspace(0.02, 0.98, 25)[:, None] * (wall[1] - wall[0])
    across = (wall[1] - wall[0])[::-1] * [-1, 1] / np.hypot(*(wall[1] - wall[0]))
    views = 0
    for pose in poses:
        to_points = points - pose[:2]
        distances = np.hypot(*to_points.T)
        ranges, _ = world.cast(pose, np.arctan2(to_points[:, 1], to_points[:, 0]) - pose[2])
        clear = (np.abs(ranges - distances) < 1e-3) & (np.abs(to_points @ across) > 0.17 * distances)
        views += clear.mean() > 0.5
    return views


def mapped_log(scans: list[Scan], extraction: ExtractionSettings) -> tuple[OccupancyGrid, Walls]:
    """Grid and walls of a recording at its reference poses, taken for 2 cm and 5 mrad off. Raises EvaluationError."""
    poses, _ = reference_poses(scans)
    grid = build_grid(scans, poses)
    covariances = np.tile(np.diag(_REFERENCE) ** 2, (len(scans), 1, 1))
    return grid, find_walls(scans, poses, covariances, grid, extraction=extraction)


def occupied_at_walls(walls: Walls, grid: OccupancyGrid) -> float:
    """Share of the occupied cells that lie at a wall, their centre within one and a half cells of it."""
    centres = grid.centres(grid.occupied)
    nearest = np.full(len(centres), np.inf)
    for a, b in walls.ends:
        length = max(float(np.hypot(*(b - a))), 1e-9)
        along = (b - a) / length
        t = np.clip((centres - a) @ along, 0, length)
        nearest = np.minimum(nearest, np.hypot(*(centres - a - t[:, None] * along).T))
    return float((nearest <= 1.5 * grid.resolution).mean()) if len(centres) else 0.0


def walls_over_free(walls: Walls, grid: OccupancyGrid) -> float:
    """Share of the length of walls that runs over cells which are free, and all eight around them."""
    around = grid.resolution * np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
    free = total = 0
    for a, b in walls.ends:
        points = a + np.linspace(0, 1, int(np.hypot(*(b - a)) / 0.01) + 1)[:, None] * (b - a)
        values = np.stack([grid.at(points + shift) for shift in around])
        free += int(((values >= 0) & (values <= 25)).all(axis=0).sum())
        total += len(points)
    return free / max(total, 1)
