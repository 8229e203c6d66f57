"""A robot's loop through two rooms with posts: known truth, odometry sightings with the noise the filter knows."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.geometry import compose, inverse
from lidarcore.localization import LocalizationSettings, Points
from lidarcore.scan import Array
from lidarcore.simulation import World

PERIOD = 0.25  # s between scans
SPEED = 0.9  # m/s
SIGHT = 6.0  # m
START_COVARIANCE = np.diag([0.02, 0.02, 0.01]) ** 2

# Two rooms of 6 x 5 m, side by side, with two doors in the wall between them.
WALLS = World(
    np.array(
        [
            [[0, 0], [12, 0]], [[12, 0], [12, 5]], [[12, 5], [0, 5]], [[0, 5], [0, 0]],
            [[6, 0], [6, 0.6]], [[6, 1.8], [6, 3.2]], [[6, 4.4], [6, 5]],
        ],
        float,
    )
)  # fmt: skip
POSTS = np.array(
    [
        [0.4, 0.4], [3, 0.4], [5.4, 0.3], [0.4, 2.6], [2.2, 2.2], [3.9, 2.7], [0.5, 4.6], [2.7, 4.7], [5.3, 4.7],
        [6.5, 0.3], [8.6, 0.4], [11.6, 0.5], [7.7, 2.4], [9.6, 2.7], [11.5, 2.5], [6.6, 4.7], [9.2, 4.6], [11.5, 4.5],
    ]
)  # fmt: skip
_ROUTE = np.array([[1.2, 1.2], [10.8, 1.2], [10.8, 3.8], [1.2, 3.8], [1.2, 1.2], [10.8, 1.2]])


def true_path(steps: int) -> Array:
    """Poses (steps, 3), world frame, along the loop with rounded corners, one scan period apart."""
    ways = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(_ROUTE, axis=0), axis=1))])
    fine = np.linspace(0, ways[-1], 4000)
    xy = np.stack([np.interp(fine, ways, column) for column in _ROUTE.T], -1)
    window = np.ones(120) / 120
    x, y = (np.convolve(column, window, "valid") for column in xy.T)
    along = np.concatenate([[0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    at = SPEED * PERIOD * np.arange(steps)
    headings = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    return np.stack([np.interp(at, along, column) for column in (x, y, headings)], -1)


def sight(pose: Array) -> Array:
    """(L,) true for the posts that no wall hides and that are near enough."""
    delta = POSTS - pose[:2]
    distance, bearings = np.hypot(*delta.T), np.arctan2(delta[:, 1], delta[:, 0]) - pose[2]
    ranges, _ = WALLS.cast(pose, bearings)
    visible: Array = (distance < SIGHT) & (ranges > distance - 1e-6)
    return visible


def draw(rng: np.random.Generator, mean: ArrayLike, covariance: Array) -> Array:
    """A Gaussian (n,), the same for the same seed on every machine; by default eigenvectors differ in their signs."""
    return rng.multivariate_normal(mean, covariance, method="cholesky")


@dataclass(frozen=True, eq=False)
class Walk:
    """What one robot sees: true poses (T, 3), odometry (T, 3), and sightings with their posts for each step."""

    poses: Array
    odometry: Array
    sightings: list[Points]
    posts: list[Array]


def walk(rng: np.random.Generator, settings: LocalizationSettings, poses: Array, seen: list[Array]) -> Walk:
    """Follow the poses; the errors are drawn from the distributions that the settings name."""
    odometry, sightings = [poses[0]], []
    for before, after in pairwise(poses):
        u = compose(inverse(before), after)
        error = draw(rng, np.zeros(3), settings.odometry.covariance(u))
        odometry.append(compose(odometry[-1], u + error))
    for pose, posts in zip(poses, seen, strict=True):
        sightings.append(sighting(rng, pose, POSTS[posts]))
    return Walk(poses, np.array(odometry), sightings, seen)


def sighting(rng: np.random.Generator, pose: Array, landmarks: Array) -> Points:
    """The landmarks (L, 2) in the sensor frame, noisier along the beam than across, with that covariance."""
    delta = landmarks - pose[:2]
    c, s = np.cos(pose[2]), np.sin(pose[2])
    z = delta @ np.array([[c, -s], [s, c]])
    along = z / np.linalg.norm(z, axis=1)[:, None]
    across = along[:, ::-1] * [-1, 1]
    sigma = np.stack([np.full(len(z), 0.03), 0.01 + 0.005 * np.linalg.norm(z, axis=1)], -1)
    axes = np.stack([along, across], -1)
    covariance = axes @ (sigma[:, :, None] ** 2 * axes.transpose(0, 2, 1))
    errors = (axes @ (sigma * rng.normal(size=z.shape))[:, :, None])[:, :, 0]
    return Points(z + errors, covariance, "post")


def nees(error: Array, covariance: Array) -> float:
    """Normalised squared error of a pose (3,)."""
    error = np.array([error[0], error[1], np.angle(np.exp(1j * error[2]))])
    return float(error @ np.linalg.solve(covariance, error))


def invariant_error(truth: Array, mean: Array) -> Array:
    """The motion (3,) m, m, rad of the whole world that takes a pose (3,) to the truth: that of an invariant filter."""
    return compose(truth, inverse(mean))


def invariant_nees(truth: Array, mean: Array, covariance: Array) -> float:
    """Normalised squared error of a pose (3,), the error told as a motion of the world."""
    J = np.eye(3)
    J[:2, 2] = mean[1], -mean[0]
    return nees(invariant_error(truth, mean), J @ covariance @ J.T)
