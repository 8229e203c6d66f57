"""A simulated building of corridors around a block, a way through it, and what a sensor sees there."""

from dataclasses import replace

import numpy as np

from lidarcore import Scan, SensorNoise
from lidarcore.arrays import Array
from lidarcore.geometry import compose, relative
from lidarcore.localization.motion_noise import OdometryNoise
from lidarcore.mapping import FrontSettings, MapperSettings, MatchSettings
from lidarcore.simulation import SimulatedSensor, World

NOISE = SensorNoise(0.015, 0.003)
SETTINGS = MapperSettings(front=FrontSettings(match=MatchSettings(noise=NOISE)))
WHEELS = OdometryNoise(
    along=0.1, across=0.1, heading_per_metre=0.1, heading_per_radian=0.15, slip_per_radian=0.05
)
# A corridor around a block, with a niche here and a pillar there.
BUILDING = World(
    np.array(
        [
            [[0, 0], [14, 0]], [[14, 0], [14, 4]], [[14, 4], [15, 4]], [[15, 4], [15, 6]], [[15, 6], [14, 6]],
            [[14, 6], [14, 10]], [[14, 10], [5, 10]], [[5, 10], [5, 10.6]], [[5, 10.6], [3, 10.6]],
            [[3, 10.6], [3, 10]], [[3, 10], [0, 10]], [[0, 10], [0, 0]],
            [[2.5, 2.5], [11.5, 2.5]], [[11.5, 2.5], [11.5, 7]], [[11.5, 7], [7, 7.5]], [[7, 7.5], [2.5, 7.5]],
            [[2.5, 7.5], [2.5, 2.5]],
            [[6, 0], [6, 0.4]], [[6, 0.4], [6.5, 0.4]], [[6.5, 0.4], [6.5, 0]],
            [[0, 6.5], [0.3, 6.5]], [[0.3, 6.5], [0.3, 7]], [[0.3, 7], [0, 7]],
        ],
        float,
    )
)  # fmt: skip


def way(step: float, rounds: float) -> Array:
    """Poses (T, 3) along the middle of the corridor, every `step` m."""
    corners = np.array([[1.25, 1.25], [12.75, 1.25], [12.75, 8.75], [1.25, 8.75], [1.25, 1.25]])
    lengths = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    along = np.arange(0, rounds * lengths[-1], step)
    x, y = (np.interp(along % lengths[-1], lengths, column) for column in corners.T)
    window = np.hanning(2 * int(1.2 / step) + 3)[1:-1]
    smooth = [
        np.convolve(np.pad(v, len(window) // 2, mode="edge"), window / window.sum(), "valid") for v in (x, y)
    ]
    headings = np.unwrap(np.arctan2(np.gradient(smooth[1]), np.gradient(smooth[0])))
    return np.stack([*smooth, headings], -1)


def sick_scan(world: World, pose: Array, noise: SensorNoise, rng: np.random.Generator) -> Scan:
    """180 beams of one degree ahead."""
    bearings = np.deg2rad(np.arange(-90.0, 90.0))
    ranges, _ = world.cast(pose, bearings + rng.normal(0, noise.sigma_bearing, 180))
    return Scan(ranges + rng.normal(0, noise.sigma_range, 180), bearings)


def full_scan(world: World, pose: Array, noise: SensorNoise, rng: np.random.Generator) -> Scan:
    """920 beams all around, all at once."""
    return replace(SimulatedSensor(world, noise).scan(pose, rng)[0], beam_times=None)


def drive(poses, rng, scanned=sick_scan, odometry=True, world=BUILDING) -> list[Scan]:
    """Scans at the poses, one a second, with the odometry of WHEELS and the true poses seen from the first."""
    driven, scans = poses[0], []
    for k, pose in enumerate(poses):
        if k:
            u = relative(poses[k - 1], pose)
            noise = rng.multivariate_normal(np.zeros(3), WHEELS.covariance(u), method="cholesky")
            driven = compose(driven, u + noise)
        scan = scanned(world, pose, NOISE, rng)
        truth = relative(poses[0], pose)
        scans.append(replace(scan, stamp=float(k), odometry=driven if odometry else None, truth=truth))
    return scans
