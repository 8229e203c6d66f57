"""Scans from known places in simulated rooms, and what scan-matching tests ask of them."""

import numpy as np

from lidarcore import Scan, SensorNoise
from lidarcore.poses import compose, wrap
from lidarcore.scan import Array
from lidarcore.scanmatching import MatchSettings, ScanMatch, match_scans
from lidarcore.simulation import SimulatedSensor, World

GUESS = np.diag([0.1, 0.1, 0.08]) ** 2  # covariance of the guesses, m², m², rad²


def sick_scan(world: World, pose: Array, noise: SensorNoise, rng: np.random.Generator) -> Scan:
    """180 beams of one degree ahead."""
    bearings = np.deg2rad(np.arange(-90.0, 90.0))
    ranges, _ = world.cast(pose, bearings + rng.normal(0, noise.sigma_bearing, 180))
    return Scan(ranges + rng.normal(0, noise.sigma_range, 180), bearings)


def full_scan(world: World, pose: Array, noise: SensorNoise, rng: np.random.Generator) -> Scan:
    """920 beams all around."""
    return SimulatedSensor(world, noise).scan(pose, rng)[0]


def step_from(world: World, pose: Array, rng: np.random.Generator) -> Array:
    """A step (3,) of up to 0.8 m and 0.35 rad that hits no wall."""
    while True:
        step = rng.uniform([-0.8, -0.2, -0.35], [0.8, 0.2, 0.35])
        way, there = np.hypot(*step[:2]), compose(pose, step)
        free, _ = world.cast(pose, np.array([np.arctan2(step[1], step[0])]))
        if free[0] > way + 0.2 and world.clearance(there[0], there[1]) > 0.3:
            return step


def matched(
    reference: Scan, scan: Scan, step: Array, noise: SensorNoise, rng: np.random.Generator
) -> tuple[Array, ScanMatch]:
    """Error (3,) of a match from a guess with errors as its covariance says, and the match."""
    guess = step + rng.multivariate_normal(np.zeros(3), GUESS, method="cholesky")
    match = match_scans(reference, scan, guess, GUESS, MatchSettings(noise=noise))
    error = match.pose - step
    error[2] = wrap(error[2])
    return error, match


def squared(error: Array, covariance: Array) -> float:
    """Squared Mahalanobis distance."""
    return float(error @ np.linalg.solve(covariance, error))
