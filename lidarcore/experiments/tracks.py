"""Where a robot believes it was, by odometry alone or by the filter, and how far off that is."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from lidarcore.arrays import Array
from lidarcore.clusters import Clusters
from lidarcore.geometry import (
    UncertainPose,
    act,
    act_jacobians,
    pose_difference,
    relative,
    squared_mahalanobis,
)
from lidarcore.localization import LocalizationSettings, OdometryNoise, Points
from lidarcore.localization.ekf.slam import Slam
from lidarcore.scan import Scan
from lidarcore.simulation.paths import Path
from lidarcore.simulation.worlds import Place

START = np.diag([1e-3, 1e-3, 1e-3]) ** 2
"""Covariance of the start pose, which is known: m and rad."""


@dataclass(frozen=True, eq=False)
class Drive:
    """What the robot of one run perceived on one trajectory, and what there was."""

    place: Place
    scans: Sequence[Scan]

    @cached_property
    def truth(self) -> Array:
        """T_world_sensor (N, 3) at each scan."""
        return np.array([scan.truth for scan in self.scans])

    @cached_property
    def odometry(self) -> Array:
        """T_odom_sensor (N, 3) at each scan; the start is the true one."""
        return np.array([scan.odometry for scan in self.scans])


@dataclass(frozen=True, eq=False, slots=True)
class Track:
    """A drive as it was believed.

    stamps (N,) s; poses (N, 3) T_world_sensor with covariances (N, 3, 3); seen (N,) clusters that were used
    landmarks (L, 2) m with covariances (L, 2, 2), world frame: with the filter the map at the end, without it every
    cluster where it was drawn, of_scan (L,) the scan it is from
    """

    stamps: Array
    poses: Array
    covariances: Array
    seen: Array
    landmarks: Array
    landmark_covariances: Array
    of_scan: Array


@dataclass(frozen=True, slots=True)
class Errors:
    """How far a track is off.

    accumulated  m: sum over the scans of the distance in y from the trajectory at the same x, as the paper has it
    rms, largest, final
                 m: distance between estimated and true position, over all scans and at the last one
    anees        mean of the normalised squared error of the pose over its dimension: 1 if the covariance is true
    """

    accumulated: float
    rms: float
    largest: float
    final: float
    anees: float


def measurements(clusters: Clusters) -> Points:
    """Clusters as the filter takes them: the covariance is that of the members [EKF, steps 4 and 5] and of their mean.

    The scatter of the members stands for what the mean does not tell: on which side of the object they are.
    """
    return Points(clusters.means, clusters.scatters + clusters.covariances, "cluster")


def dead_reckoned(drive: Drive, clusters: Sequence[Clusters], noise: OdometryNoise) -> Track:
    """The track by odometry alone; clusters, rotated into the world, have the covariance of the pose, too [EKF 17]."""
    covariances = [START]
    for before, after in pairwise(drive.odometry):
        u, last = relative(before, after), UncertainPose(before, covariances[-1])
        covariances.append(last.compose(UncertainPose(u, noise.covariance(u))).covariance)
    placed = [
        _placed(pose, P, of_scan)
        for pose, P, of_scan in zip(drive.odometry, covariances, clusters, strict=True)
    ]
    counts = np.array([len(of_scan) for of_scan in clusters], np.float64)
    return Track(
        np.array([scan.stamp for scan in drive.scans]),
        drive.odometry,
        np.array(covariances),
        counts,
        np.concatenate([xy for xy, _ in placed]),
        np.concatenate([covariance for _, covariance in placed]),
        np.repeat(np.arange(len(clusters), dtype=np.float64), counts.astype(int)),
    )


def _placed(pose: Array, P: Array, clusters: Clusters) -> tuple[Array, Array]:
    """Means (K, 2) m in the world and covariances (K, 2, 2): of the object's region, and of the pose."""
    G_pose, R_world_sensor = act_jacobians(pose, clusters.means)
    region = R_world_sensor @ clusters.scatters @ R_world_sensor.T
    return act(pose, clusters.means), region + G_pose @ P @ G_pose.transpose(0, 2, 1)


def filtered(drive: Drive, clusters: Sequence[Clusters | None], settings: LocalizationSettings) -> Track:
    """The track by the SLAM filter on the clusters of each scan; None for a scan in which nothing was seen."""
    slam = Slam(settings, drive.odometry[0], START)
    nothing = Points(np.empty((0, 2)), np.eye(2), "cluster")
    estimates = [
        slam.step(nothing if of_scan is None else measurements(of_scan), scan.stamp, scan.odometry)
        for scan, of_scan in zip(drive.scans, clusters, strict=True)
    ]
    confirmed = slam.confirmed
    return Track(
        np.array([estimate.stamp for estimate in estimates]),
        np.array([estimate.pose for estimate in estimates]),
        np.array([estimate.covariance for estimate in estimates]),
        np.array([0.0 if of_scan is None else len(of_scan) for of_scan in clusters]),
        slam.landmarks.xy[confirmed],
        slam.landmarks.covariance[confirmed],
        np.full(int(confirmed.sum()), len(clusters) - 1.0),
    )


def errors(track: Track, truth: Array, path: Path) -> Errors:
    """Errors of a track along a path whose y is a function of its x, against the truth (N, 3)."""
    difference = pose_difference(track.poses, truth)
    distance = np.hypot(difference[:, 0], difference[:, 1])
    nees = squared_mahalanobis(difference, track.covariances)
    return Errors(
        accumulated=float(off_in_y(track.poses, path).sum()),
        rms=float(np.sqrt((distance**2).mean())),
        largest=float(distance.max()),
        final=float(distance[-1]),
        anees=float(nees.mean() / 3),
    )


def off_in_y(poses: Array, path: Path) -> Array:
    """Distance in y (N,) m of poses (N, 3) from the path at the same x; 0 where the path does not reach that x."""
    xs, ys = path(np.arange(0, 60, 0.01))[:, :2].T
    inside = (poses[:, 0] >= xs[0]) & (poses[:, 0] <= xs[-1])
    return np.where(inside, np.abs(poses[:, 1] - np.interp(poses[:, 0], xs, ys)), 0.0)
