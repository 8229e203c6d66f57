"""A robot that drives through a simulated world: its scans, with what its wheels say and where it truly is."""

from collections.abc import Iterator
from itertools import count

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import compose, relative, wrap
from lidarcore.scan import Scan
from lidarcore.simulation.people import Person
from lidarcore.simulation.scene import Optics, Scene
from lidarcore.simulation.settings import OdometryError, SimulationSettings
from lidarcore.simulation.worlds import Place, place, way

RATE = 10.0
"""Revolutions per second of the sensor."""
BEAMS = 920
"""Beams in a whole turn of the sensor."""
_NEAREST = 0.1  # m


class SimulatedRobot:
    """Endless scans, RATE a second: each with beam times, odometry (from the true start pose on) and truth.

    The sensor turns counter-clockwise, moves from beam to beam, and its stamp, odometry and truth are of the first
    beam in view. The same settings give the same scans, and each random part has a stream of its own: another error
    of the odometry leaves the ranges as they are.

    other    a place that is not listed in WORLDS, instead of the settings' world
    begin    stamp of the first revolution, s
    """

    def __init__(
        self, settings: SimulationSettings | None = None, other: Place | None = None, begin: float = 0.0
    ) -> None:
        self.settings = settings or SimulationSettings()
        self.place = other or place(self.settings.world)
        self.path = self.place.path(self.settings.path)
        self.begin = begin

    def __iter__(self) -> Iterator[Scan]:
        settings = self.settings
        of_sensor, of_odometry, of_people = (
            np.random.default_rng(seed) for seed in np.random.SeedSequence(settings.seed).spawn(3)
        )
        world = self.place.world.uneven(settings.noise, settings.seed)
        scene = Scene(world, self.path, self._people(of_people), self.place.posts)
        optics = Optics(
            settings.noise, settings.mixed, settings.dropouts, limits=(_NEAREST, settings.max_range)
        )
        wheels = _Wheels(settings.odometry, of_odometry)
        for revolution in count():
            times, bearings = self._beams(revolution / RATE, of_sensor)
            truth = self._pose(times[0])
            aimed = bearings + of_sensor.normal(0, settings.noise.sigma_bearing, len(bearings))
            ranges, quality = optics.observe(*scene.cast(times, aimed), of_sensor)
            stamp, since = self.begin + float(times[0]), times - times[0]
            yield Scan(ranges, bearings, stamp, quality, since, wheels.measure(truth), truth=truth)

    def _beams(self, time: float, rng: np.random.Generator) -> tuple[Array, Array]:
        """Times and bearings (N,) of the beams in view in a revolution that begins at a time; the first is random."""
        turned = (np.arange(BEAMS, dtype=np.float64) + rng.uniform()) / BEAMS
        bearings = 2 * np.pi * turned - np.pi
        in_view = np.abs(bearings) <= self.settings.field_of_view / 2
        return time + turned[in_view] / RATE, bearings[in_view]

    def _pose(self, time: float) -> Array:
        x, y, heading = self.path(np.array([time]))[0]
        return np.array([x, y, wrap(heading)])

    def _people(self, rng: np.random.Generator) -> list[Person]:
        avoid = way(self.path)
        if self.place.posts is not None:
            avoid = np.concatenate([avoid, self.place.posts.centres])
        return [Person(self.place.world, rng, avoid) for _ in range(self.settings.people)]


class _Wheels:
    """What adds up wheel turns: T_odom_sensor, the true pose to begin with."""

    def __init__(self, error: OdometryError, rng: np.random.Generator) -> None:
        self._error, self._rng = error, rng
        self._before: Array | None = None
        self._odometry = np.zeros(3)

    def measure(self, truth: Array) -> Array:
        """T_odom_sensor (3,) once the sensor has come to T_world_sensor (3,)."""
        if self._before is None:
            self._odometry = truth
        else:
            moved = relative(self._before, truth)
            self._odometry = compose(self._odometry, self._error.measured(moved, self._rng))
        self._before = truth
        return self._odometry
