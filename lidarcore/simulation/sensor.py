"""A simulated sensor: true ranges with the noise of the model, at bearings that change from scan to scan."""

from dataclasses import dataclass, field

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import wrap
from lidarcore.noise import SensorNoise
from lidarcore.scan import Scan
from lidarcore.simulation.world import World

RATE = 10.0  # revolutions per second, as an RPLIDAR S1 turns


@dataclass(slots=True)
class SimulatedSensor:
    """A 360 degree sensor of `beams` beams per revolution in a world, whose walls are as even as the world says."""

    world: World
    noise: SensorNoise = field(default_factory=lambda: SensorNoise(0.01, 0.001))
    beams: int = 920
    max_range: float = 40.0

    def scan(self, pose: Array, rng: np.random.Generator, stamp: float = 0.0) -> tuple[Scan, Ints]:
        """One scan from pose (x m, y m, heading rad), and the wall (N,) each beam met, -1 for none.

        The first beam starts at a random angle; each reports a bearing and a range with errors of their own.
        """
        turns = (np.arange(self.beams, dtype=np.float64) + rng.uniform()) / self.beams
        true_bearings: Array = 2 * np.pi * turns - np.pi
        ranges, hit = self.world.cast(pose, true_bearings)
        ranges = ranges + np.sqrt(self.noise.range_variances(ranges)) * rng.normal(size=self.beams)
        bearings = wrap(true_bearings + rng.normal(0, self.noise.sigma_bearing, self.beams))
        ranges[ranges > self.max_range] = np.nan
        quality = np.where(np.isnan(ranges), 0.0, np.clip(60 - 4 * ranges, 5, 60))
        times = np.arange(self.beams) / (RATE * self.beams)
        order = np.argsort(bearings)  # noise may swap neighbours; a real sensor's angles grow
        return Scan(ranges[order], bearings[order], stamp, quality[order], times), hit[order]
