"""What a filter makes of the ellipses it is fed: the localizer in a known room, fed by one method or another."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lidarcore.evaluation.intervals import Interval, ratio, share
from lidarcore.experiments.corner_study import Method
from lidarcore.extraction import compare
from lidarcore.features import Features
from lidarcore.geometry import compose, pose_difference, relative, squared_mahalanobis, wrap
from lidarcore.localization import LocalizationSettings, Localizer, Points
from lidarcore.scan import Array
from lidarcore.settings import ExtractionSettings
from lidarcore.simulation import SimulatedSensor
from lidarcore.simulation.rooms import rectangular_room

from .views import Situation

SETTINGS = LocalizationSettings()
_START = np.diag([0.02, 0.02, 0.01]) ** 2
_SURVEYED = 0.001  # m, standard deviation of the corners in the map
_PERIOD, _STEP = 0.25, 0.06  # s and rad from scan to scan, around the middle of the room
_AROUND = 0.2  # of length and width: half axes of the way
_SUMS = 5  # of a run: normalised squared error, squared error, claimed variance, corners seen, those not used


@dataclass(frozen=True, slots=True)
class Filtered:
    """One method's ellipses in the filter: what it claims of the position, m, and what is so.

    unused: share of the corners seen, all of which are in the map, that it took for none of them.
    """

    error: Interval
    claimed: Interval
    anees: Interval
    unused: Interval


def filtered(
    situation: Situation, methods: Sequence[Method], runs: int, steps: int, seed: int
) -> Mapping[Method, Filtered]:
    """Drives around the middle of the room; every method is shown the same scans and odometry."""
    rng = np.random.default_rng(seed)
    sums = np.array([_run(situation, methods, steps, rng) for _ in range(runs)])
    return {method: _figures(sums[:, k], steps) for k, method in enumerate(methods)}


def _figures(sums: Array, steps: int) -> Filtered:
    nees, square, claimed, seen, unused = sums.T
    scans = np.full(len(sums), float(steps))
    return Filtered(
        ratio(square, scans).root(), ratio(claimed, scans).root(), ratio(nees, 3 * scans), share(unused, seen)
    )


def _run(situation: Situation, methods: Sequence[Method], steps: int, rng: np.random.Generator) -> Array:
    """Sums (methods, _SUMS) over the scans of one drive."""
    world = rectangular_room(situation.length, situation.width)
    sensor = SimulatedSensor(world, situation.noise)
    poses = _way(situation, steps, rng)
    odometry = _driven(poses, rng)
    start = rng.multivariate_normal(poses[0], _START, method="cholesky")
    known = Points(world.walls[:, 0], _SURVEYED**2 * np.eye(2))
    localizers = {method: Localizer(known, start, _START, SETTINGS) for method in methods}
    settings, fitters = ExtractionSettings(noise=situation.noise), list(dict.fromkeys(f for f, _ in methods))
    sums = np.zeros((len(methods), _SUMS))
    for k, pose in enumerate(poses):
        found = compare(sensor.scan(pose, rng)[0], settings, fitters)
        for m, method in enumerate(methods):
            observed = _observed(found, method)
            estimate = localizers[method].step(observed, _PERIOD * k, odometry[k])
            error = pose_difference(estimate.pose, pose)
            used = len(estimate.association.observed)
            sums[m] += [
                squared_mahalanobis(error, estimate.covariance),
                error[:2] @ error[:2],
                np.trace(estimate.covariance[:2, :2]),
                len(observed),
                len(observed) - used,
            ]
    return sums


def _observed(found: Mapping[str, Features], method: Method) -> Points:
    fitter, kind = method
    corners = found[fitter].corners
    return Points(corners.xy, getattr(corners, f"covariance_{kind}"))


def _way(situation: Situation, steps: int, rng: np.random.Generator) -> Array:
    """True poses (steps, 3) on an ellipse around the middle."""
    angle = rng.uniform(0, 2 * np.pi) + _STEP * np.arange(steps)
    x, y = _AROUND * situation.length * np.cos(angle), _AROUND * situation.width * np.sin(angle)
    return np.stack([x, y, wrap(angle + np.pi / 2)], -1)


def _driven(poses: Array, rng: np.random.Generator) -> Array:
    """Odometry (steps, 3) with the errors that the filter is told of."""
    odometry = [poses[0]]
    for before, after in pairwise(poses):
        u = relative(before, after)
        noise = SETTINGS.odometry.covariance(u, _PERIOD)
        odometry.append(
            compose(odometry[-1], u + rng.multivariate_normal(np.zeros(3), noise, method="cholesky"))
        )
    return np.array(odometry)
