"""The experiment of [EKF]: clusters of lidar points as landmarks, with and without a Kalman filter.

[EKF]: R. Urvina Córdova, E. Aguilar Torres and A. Prado Romo, on simultaneous localization and mapping with lidar
point clouds and machine learning methods. A robot follows each of three trajectories through objects at random; four
methods cluster what its lidar sees, and its pose comes from odometry alone, from the filter, or from the filter
while the objects are out of sight for some seconds.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice, pairwise

import numpy as np

from lidarcore.arrays import Array
from lidarcore.clusters import CLUSTERERS, Clusters, ClusterSettings, cluster
from lidarcore.evaluation.workers import run_all
from lidarcore.experiments.tracks import Drive, Errors, Track, dead_reckoned, errors, filtered
from lidarcore.geometry import relative
from lidarcore.localization import LocalizationSettings, OdometryNoise, deskew
from lidarcore.noise import SensorNoise
from lidarcore.scan import Scan
from lidarcore.simulation.posts import scattered
from lidarcore.simulation.robot import RATE, SimulatedRobot
from lidarcore.simulation.settings import OdometryError, SimulationSettings
from lidarcore.simulation.worlds import hall, trajectories, way

METHODS = tuple(CLUSTERERS)
TRAJECTORIES = tuple(trajectories())
MODES = ("without", "with", "lost")
"""Without the filter, with it, and with it while the objects are lost for some seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """What is simulated. Range and angle of the sensor are the paper's; where it is silent, this says what is assumed.

    every          a scan of so many is used; the sensor makes RATE a second
    posts, radius  how many objects there are, round, of this radius (m)
    apart          m between their centres, at least
    blind          from when to when (s) the objects are lost
    """

    runs: int = 20
    seed: int = 0
    every: int = 2
    max_range: float = 8.0
    field_of_view: float = np.pi
    posts: int = 30
    radius: float = 0.1
    apart: float = 0.6
    blind: tuple[float, float] = (8.0, 13.0)
    noise: SensorNoise = field(default_factory=lambda: SensorNoise(0.01, 0.001))
    odometry: OdometryNoise = field(default_factory=OdometryNoise)

    def clusters(self, method: str) -> ClusterSettings:
        """Default settings of a method, which chooses the number of clusters itself if it needs one."""
        return ClusterSettings(method=method, noise=self.noise)

    def localization(self) -> LocalizationSettings:
        """Default settings of the filter, which knows the noise of the odometry."""
        return LocalizationSettings(odometry=self.odometry)

    def quick(self) -> "Design":
        """This design with one scan a second, to try it out."""
        return replace(self, every=10)


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one method made of one drive along one trajectory.

    clustering_s, filter_s  processor time of all its scans, s
    given_k_s               processor time of the clustering if the number of clusters is told, s
    clusters, landmarks     of all scans together; confirmed by the filter
    errors, tracks          by mode; tracks of the first run only
    """

    run: int
    trajectory: str
    method: str
    scans: int
    clusters: int
    landmarks: int
    clustering_s: float
    given_k_s: float
    filter_s: float
    errors: dict[str, Errors]
    tracks: dict[str, Track]


@dataclass(frozen=True, eq=False)
class ClusteringStudy:
    """All outcomes of an experiment, sorted by run, trajectory and method."""

    design: Design
    outcomes: Sequence[Outcome]

    def values(self, of: Callable[[Outcome], float]) -> Array:
        """A number of each outcome: (runs, trajectories, methods)."""
        shape = (self.design.runs, len(TRAJECTORIES), len(METHODS))
        return np.array([of(outcome) for outcome in self.outcomes]).reshape(shape)

    def error(self, mode: str, name: str) -> Array:
        """An error by its name in Errors: (runs, trajectories, methods)."""
        return self.values(lambda outcome: float(getattr(outcome.errors[mode], name)))


def run(design: Design, workers: int = 1, done: Callable[[], None] = lambda: None) -> ClusteringStudy:
    """The whole experiment; `done` is called after each of the runs times trajectories drives.

    All but the times is the same for the same design, whatever the number of workers.
    """
    drives = [(run, trajectory) for run in range(design.runs) for trajectory in TRAJECTORIES]
    outcomes = run_all(partial(outcomes_of_drive, design), drives, workers, done)
    return ClusteringStudy(design, [outcome for of_drive in outcomes for outcome in of_drive])


def outcomes_of_drive(design: Design, drive_: tuple[int, str]) -> list[Outcome]:
    """What each method makes of the same scans."""
    number, trajectory = drive_
    drive = simulate(design, number, trajectory)
    return [_outcome(design, number, trajectory, drive, method) for method in METHODS]


def simulate(design: Design, number: int, trajectory: str) -> Drive:
    """One drive. The objects are those of the run, whatever the trajectory; the errors are its own."""
    paths = trajectories()
    path, ways = paths[trajectory], np.concatenate([way(path) for path in paths.values()])
    objects = np.random.default_rng([design.seed, number])
    area = (-1.0, 23.0, -6.0, 6.0)
    posts = scattered(objects, design.posts, area, ways, radius=design.radius, apart=design.apart)
    settings = SimulationSettings(
        field_of_view=design.field_of_view,
        max_range=design.max_range,
        noise=design.noise,
        odometry=OdometryError(noise=design.odometry),
        seed=int(
            np.random.default_rng([design.seed, number, TRAJECTORIES.index(trajectory)]).integers(2**31)
        ),
    )
    place = hall(posts, {trajectory: path})
    scans = list(islice(SimulatedRobot(settings, place), int(path.duration * RATE)))[:: design.every]
    return Drive(place, _deskewed(scans))


def _deskewed(scans: Sequence[Scan]) -> list[Scan]:
    """The scans as if the robot had stood, by the speed that odometry has since the scan before; at first it stands."""
    straight = [scans[0]]
    for before, scan in pairwise(scans):
        assert before.odometry is not None
        assert scan.odometry is not None
        moved = relative(before.odometry, scan.odometry) / (scan.stamp - before.stamp)
        straight.append(deskew(scan, moved[0], moved[2]))
    return straight


def _outcome(design: Design, number: int, trajectory: str, drive: Drive, method: str) -> Outcome:
    settings = design.clusters(method)
    clusters, clustering_s = _clustered(drive.scans, [settings] * len(drive.scans))
    counts = [max(len(of_scan), 1) for of_scan in clusters]
    _, given_k_s = _clustered(drive.scans, [replace(settings, k=k) for k in counts])
    begin = time.thread_time()
    whole = filtered(drive, clusters, design.localization())
    filter_s = time.thread_time() - begin
    tracks = {
        "without": dead_reckoned(drive, clusters, design.odometry),
        "with": whole,
        "lost": filtered(drive, _blinded(drive, clusters, design.blind), design.localization()),
    }
    return Outcome(
        number,
        trajectory,
        method,
        len(drive.scans),
        sum(len(of_scan) for of_scan in clusters),
        len(whole.landmarks),
        clustering_s,
        given_k_s,
        filter_s,
        {mode: errors(track, drive.truth, drive.place.path(trajectory)) for mode, track in tracks.items()},
        tracks if number == 0 else {},
    )


def _clustered(scans: Sequence[Scan], settings: Sequence[ClusterSettings]) -> tuple[list[Clusters], float]:
    """Clusters of each scan by the settings for it, and the processor time that took, s."""
    cluster(scans[0], settings[0])  # loads what the method needs, before the clock runs
    begin = time.thread_time()
    clusters = [cluster(scan, of_scan) for scan, of_scan in zip(scans, settings, strict=True)]
    return clusters, time.thread_time() - begin


def _blinded(drive: Drive, clusters: Sequence[Clusters], blind: tuple[float, float]) -> list[Clusters | None]:
    """The clusters, none while the sensor is blind."""
    return [
        None if blind[0] <= scan.stamp < blind[1] else of_scan
        for scan, of_scan in zip(drive.scans, clusters, strict=True)
    ]
