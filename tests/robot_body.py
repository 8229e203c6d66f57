"""Scans of a sensor that drives about in a room and sees two posts of the robot that carries it."""

import numpy as np

from lidarcore import Scan, SensorNoise
from lidarcore.simulation import SimulatedSensor, furnished_room, random_pose

POSTS = ((3.05, 0.08, 0.24), (1.2, 0.05, 0.35))  # bearing, half width (rad), range (m); one across the wrap


def drive(count: int = 60, moving: bool = True) -> list[Scan]:
    """A second apart from each other, so that ranges to the room are never alike, at 10 Hz."""
    rng = np.random.default_rng(5)
    room = furnished_room()
    sensor, still = SimulatedSensor(room, SensorNoise(0.01, 0.001)), random_pose(room, rng)
    return [
        with_posts(sensor.scan(random_pose(room, rng) if moving else still, rng)[0], rng, stamp=100 + 0.1 * k)
        for k in range(count)
    ]


def with_posts(scan: Scan, rng: np.random.Generator, stamp: float = 0.0) -> Scan:
    """The scan with the posts in it."""
    ranges = scan.ranges.copy()
    for bearing, half, at in POSTS:
        on = _off(scan, bearing) < half
        ranges[on] = at + rng.normal(0, 0.005, on.sum())
    return Scan(ranges, scan.bearings, stamp=stamp)


def on_posts(scan: Scan) -> np.ndarray:
    """(N,) true for the beams that meet a post."""
    return np.any([_off(scan, bearing) < half for bearing, half, _ in POSTS], axis=0)


def _off(scan: Scan, bearing: float) -> np.ndarray:
    return np.abs((scan.bearings - bearing + np.pi) % (2 * np.pi) - np.pi)
