"""How long the filters of localization take on this machine, beside yardsticks in the same run."""

import time
from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array
from lidarcore.evaluation.speed.extraction import Timing, time_calls
from lidarcore.geometry import act_inverse
from lidarcore.localization import LocalizationSettings, Localizer, Points, Slam
from lidarcore.localization.ekf.motion import OdometryMotion
from lidarcore.localization.ekf.passive import one_thread
from lidarcore.localization.ekf.sighting_kernels import correct
from lidarcore.localization.landmarks import Landmarks

CORNERS = 12  # landmarks in sight of the localizer
REACH, SPACING = 5.0, 2.2  # m, how far SLAM sees; m between landmarks
SCANS = 450  # of SLAM
REPEATS = 5  # of the full filter
PERIOD, SPEED, SIGMA = 0.1, 1.0, 0.02  # s between scans, m/s, m of a sighting
SETTLING = 50  # scans that are not timed: the first compile, or load, what they need
COVARIANCE = np.diag([0.02, 0.02, 0.01]) ** 2


@dataclass(frozen=True, slots=True)
class ScanTimes:
    """Mean, 99th percentile and worst processor time of a whole Slam.step, ms; the mean it should stay below, if set.

    in_sight  landmarks per scan, on average
    full      a full filter in numpy, its association given: mean, ms
    """

    landmarks: int
    in_sight: float
    mean: float
    p99: float
    worst: float
    full: float
    limit: float | None


def time_localizer(seed: int = 0) -> list[Timing]:
    """Three states, odometry, 12 landmarks of a known map matched at each scan; the yardstick solves 3 x 3."""
    rng = np.random.default_rng(seed)
    xy, pose = rng.uniform(-4, 4, (CORNERS, 2)), np.zeros(3)
    known = Points(xy, 1e-4 * np.eye(2))
    seen = Points(xy + rng.normal(0, SIGMA, xy.shape), SIGMA**2 * np.eye(2))
    localizer, stamps = Localizer(known, pose, COVARIANCE), iter(np.arange(0, 1e6, PERIOD))
    motion, given = OdometryMotion(LocalizationSettings().odometry), np.full(CORNERS, -1)
    x, P = pose.copy(), COVARIANCE.copy()
    increment, innovation = np.array([0.1, 0.0, 0.02]), np.zeros((CORNERS, 2))

    def predict_and_update() -> None:
        motion.advance(x, P, 3, PERIOD, increment)
        correct(x, P, 3, xy, innovation, seen.covariance, given)

    return [
        time_calls("yardstick: np.linalg.solve, 3 x 3", lambda: np.linalg.solve(COVARIANCE, pose), 1),
        time_calls("predict and update, 12 pairs given", predict_and_update, 1, 2),
        time_calls(
            "Localizer.step, association too", lambda: localizer.step(seen, float(next(stamps)), pose), 1
        ),
    ]


def time_slam(landmarks: int, limit: float | None) -> ScanTimes:
    """Along a path through a map of so many landmarks, all of which it knows from the start."""
    rng = np.random.default_rng(0)
    world, poses = _world(landmarks, rng), _path(landmarks, SCANS)
    points = Points(world + rng.normal(0, SIGMA, world.shape), SIGMA**2 * np.eye(2))
    slam = Slam(LocalizationSettings(), poses[0], COVARIANCE, Landmarks.of(points))
    times, in_sight = np.empty(SCANS), np.empty(SCANS)
    for k, pose in enumerate(poses):
        seen = _sightings(pose, world, rng)
        start = time.thread_time()
        slam.step(seen, PERIOD * k, pose)
        times[k], in_sight[k] = 1e3 * (time.thread_time() - start), len(seen)
    timed = times[SETTLING:]
    yardstick = _time_full_filter(landmarks, round(float(in_sight.mean())))
    return ScanTimes(
        landmarks, float(in_sight.mean()), float(timed.mean()), float(np.percentile(timed, 99)), float(timed.max()),
        yardstick, limit,
    )  # fmt: skip


def _world(landmarks: int, rng: np.random.Generator) -> Array:
    side = int(np.ceil(np.sqrt(landmarks)))
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1).reshape(-1, 2)[:landmarks]
    return SPACING * grid + rng.uniform(-0.5, 0.5, grid.shape)


def _path(landmarks: int, scans: int) -> Array:
    """Poses (scans, 3) along loops through most of the map."""
    size = SPACING * np.sqrt(landmarks)
    radius = max(0.35 * size, 3.0)
    turns = np.arange(scans) * PERIOD * SPEED / radius
    xy = size / 2 + radius * np.stack([np.sin(turns), 0.9 * np.sin(2.1 * turns + 0.3)], -1)
    dx, dy = np.gradient(xy, axis=0).T
    return np.column_stack([xy, np.arctan2(dy, dx)])


def _sightings(pose: Array, world: Array, rng: np.random.Generator) -> Points:
    xy = act_inverse(pose, world)
    near = xy[(np.hypot(*xy.T) < REACH) & (rng.random(len(world)) < 0.9)]
    return Points(near + rng.normal(0, SIGMA, near.shape), SIGMA**2 * np.eye(2))


@one_thread
def _time_full_filter(landmarks: int, pairs: int) -> float:
    """Mean time, ms, to predict and correct all of a map by so many pairs as in the textbook, H being sparse."""
    n = 3 + 2 * landmarks
    P, F, R = SIGMA**2 * np.eye(n), np.eye(3), SIGMA**2 * np.eye(2 * pairs)
    columns, H = np.arange(3 + 2 * pairs), np.ones((2 * pairs, 3 + 2 * pairs))
    start = time.thread_time()
    for _ in range(REPEATS):
        P[:3] = F @ P[:3]
        P[:, :3] = P[:, :3] @ F.T
        PHt = P[:, columns] @ H.T
        K = np.linalg.solve(H @ PHt[columns] + R, PHt.T).T
        P -= K @ PHt.T
    return 1e3 * (time.thread_time() - start) / REPEATS
