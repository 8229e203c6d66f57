"""Paths along given curves, driven as fast as limits of speed, turn rate and acceleration allow."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lidarcore.arrays import Array

_STEP = 0.02  # m between the points of a curve
_PIVOT = 64  # steps of half a turn on the spot


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of a robot: speed m/s, turn rate rad/s, and acceleration m/s².

    A turn accelerates as the way that takes as long at full speed.
    """

    speed: float = 0.8
    turn_rate: float = 1.0
    acceleration: float = 0.5


class Route:
    """A path: poses (N, 3) at times (N,) s, from standstill to standstill.

    poses     (M, 3) m, m, rad along the way, close to each other, headings without jumps of a turn
    repeats   starts again from the beginning, which is where it ends; otherwise it goes on standing
    """

    def __init__(self, poses: Array, limits: Limits, *, repeats: bool) -> None:
        self.poses, self.repeats = poses, repeats
        self._way, self._speeds = _speeds(poses, limits)
        self._lasts = 2 * np.diff(self._way) / (self._speeds[1:] + self._speeds[:-1])
        self._times = np.concatenate([[0], np.cumsum(self._lasts)])

    @property
    def duration(self) -> float:
        """Seconds from one end to the other."""
        return float(self._times[-1])

    def __call__(self, times: Array) -> Array:
        """Poses (N, 3) m, m, rad at times (N,) s."""
        at = times % self.duration if self.repeats else times
        step = np.clip(np.searchsorted(self._times, at, "right") - 1, 0, len(self._lasts) - 1)
        since, lasts = np.clip(at - self._times[step], 0, self._lasts[step]), self._lasts[step]
        before, after = self._speeds[step], self._speeds[step + 1]
        way = self._way[step] + before * since + (after - before) * since**2 / (2 * lasts)
        return np.stack([np.interp(way, self._way, column) for column in self.poses.T], -1)


def drive(curve: ArrayLike, limits: Limits | None = None) -> Route:
    """Along a curve (M, 2) m from one end to the other, looking ahead."""
    return Route(_with_headings(_resampled(curve)), limits or Limits(), repeats=False)


def drive_round(waypoints: ArrayLike, rounding: float, limits: Limits | None = None) -> Route:
    """Round and round along a closed polygon (M, 2) m whose corners are cut over `rounding` m of the way.

    The first point should lie on a side: there the robot stops for a moment in every round.
    """
    corners = np.array(waypoints, np.float64)
    xy = _resampled(np.vstack([corners, corners[:1]]))[:-1]
    half = int(rounding / _STEP / 4)
    for _ in range(2):  # twice, so that the curvature has no jumps
        padded = np.pad(xy, ((half, half), (0, 0)), mode="wrap")
        window = np.ones(2 * half + 1) / (2 * half + 1)
        xy = np.stack([np.convolve(column, window, "valid") for column in padded.T], -1)
    poses = _with_headings(np.vstack([xy[-1:], xy, xy[:2]]))[1:-1]
    return Route(poses, limits or Limits(), repeats=True)


def drive_there_and_back(curve: ArrayLike, limits: Limits | None = None) -> Route:
    """Along a curve (M, 2) m, half a turn to the left on the spot, back, and half a turn."""
    there = _with_headings(_resampled(curve))
    half_turn = np.array([0, 0, np.pi])
    turning = np.linspace(0, 1, _PIVOT)[1:-1, None] * half_turn
    back = there[::-1] + half_turn
    poses = np.vstack([there, there[-1] + turning, back, back[-1] + turning, there[:1] + 2 * half_turn])
    return Route(poses, limits or Limits(), repeats=True)


def _resampled(curve: ArrayLike) -> Array:
    """The curve (M, 2) at equal steps of its length."""
    points = np.array(curve, np.float64)
    along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    at = np.linspace(0, along[-1], int(along[-1] / _STEP) + 2)
    return np.stack([np.interp(at, along, column) for column in points.T], -1)


def _with_headings(xy: Array) -> Array:
    """Poses (M, 3) that look along the curve (M, 2)."""
    dx, dy = np.gradient(xy, axis=0).T
    return np.column_stack([xy, np.unwrap(np.arctan2(dy, dx))])


def _speeds(poses: Array, limits: Limits) -> tuple[Array, Array]:
    """Way (M,) m to each pose and the largest speed (M,) m/s there, a turn counting as the way that takes as long."""
    steps = np.diff(poses, axis=0)
    way = np.hypot(steps[:, 0], steps[:, 1])
    costs = np.maximum(way, limits.speed / limits.turn_rate * np.abs(steps[:, 2]))  # m
    at = np.concatenate([[0], np.cumsum(costs)])
    squared = np.full(len(poses), limits.speed**2)
    on_the_spot = way < 1e-9
    squared[1:-1][on_the_spot[1:] != on_the_spot[:-1]] = 0
    squared[[0, -1]] = 0
    # The largest speeds that accelerations allow: v² <= v_j² + 2 a |s - s_j| for all j.
    ramp = 2 * limits.acceleration * at
    squared = np.minimum.accumulate(squared - ramp) + ramp
    squared = np.minimum.accumulate((squared + ramp)[::-1])[::-1] - ramp
    return at, np.sqrt(np.maximum(squared, 0))
