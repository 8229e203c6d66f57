"""The report of the experiment of [EKF]: its tables and figures 3 to 6 anew, and its claims beside what came out."""

from collections.abc import Sequence

import numpy as np

from lidarcore import reporting
from lidarcore.evaluation.intervals import mean
from lidarcore.experiments.clustering_ekf import MODES, TRAJECTORIES, ClusteringStudy, Design
from lidarcore.experiments.clustering_ekf_claims import claims
from lidarcore.experiments.clustering_ekf_figures import NAMES, WORDS, figure3, figure4, figure5, figure6
from lidarcore.simulation.robot import RATE

TITLE = "Clusters of lidar points as landmarks, with and without a Kalman filter"


def html(result: ClusteringStudy) -> str:
    """The report as one page that needs nothing else."""
    design = result.design
    lead = (
        "The experiment of R. Urvina Córdova, E. Aguilar Torres and A. Prado Romo, “Simultaneous location and mapping "
        "for control of an autonomous mobile robot using LiDAR point cloud scans and Machine Learning methods”, "
        f"simulated again: {design.runs} runs on each of {len(TRAJECTORIES)} trajectories, seed {design.seed}. "
        "± gives the 95 % confidence interval of a mean over the runs."
    )
    sections = [
        (
            "What the paper says and what came out",
            reporting.verdicts(claims(result)) + reporting.paragraphs(*_why(design)),
        ),
        ("Run time (figure 3)", figure3(result)),
        ("Accumulated error (figure 4)", figure4(result)),
        ("Without the filter (figure 5)", figure5(result)),
        ("All drives of the first run (figure 6)", figure6(result)),
        ("Is the filter's covariance true?", _consistency(result)),
        ("What is simulated", reporting.bullets(_set_up(design))),
    ]
    return reporting.page(TITLE, lead, sections)


def _why(design: Design) -> list[str]:
    return [
        "Run time. The gap heuristic passes once over the ring of points; DBSCAN looks for the neighbours of every "
        "point first, so it cannot be faster on a scan whose order is known. k-means and the Gaussian mixture have to "
        "find out how many clusters there are by trying; told the number, they are faster, yet iterate still.",
        "Error. All methods see the same scans. The objects stand at least "
        f"{design.apart - 2 * design.radius:.1f} m clear of each other, more than the distance that separates "
        "clusters, so the methods mostly find the same ones; what differs are single points at the edges and now and "
        "then a wrong number of clusters. The paper shows one drive for each case and no interval: there, too, a few "
        "per cent may be chance.",
        "Loss. While nothing is seen the pose drifts with the odometry. Objects seen before pull it back; but some "
        "metres on, few of them are still in view, and what is seen for the first time is put where the drifted robot "
        "believes it to be. That part of the error stays until the robot comes back to older objects.",
    ]


def _set_up(design: Design) -> list[str]:
    return [
        f"From the paper: the sensor looks {np.degrees(design.field_of_view):.0f}° ahead and {design.max_range:g} m "
        "far; objects stand at random; three trajectories, the same for every method; odometry with error; "
        "unicycle motion; the filter knows its start. The error is the distance in y from the trajectory at "
        "the same x, summed up.",
        "Assumed, for the text does not say: the trajectories are a straight line, a lane change and a sine, "
        "20 m long in x, driven at up to 1 m/s; objects are "
        f"{design.posts} round posts of {100 * design.radius:g} cm radius in 24 x 12 m, {design.apart:g} m apart at "
        "least and 0.8 m off the trajectories; the same for all three trajectories of a run.",
        f"The sensor makes {RATE:g} scans a second of 920 beams a turn, with {1e3 * design.noise.sigma_range:g} mm and "
        f"{1e3 * design.noise.sigma_bearing:g} mrad noise; half of the beams that meet an edge report a range in "
        f"between, 0.3 % get lost. Every scan numbered a multiple of {design.every} is used, straightened by odometry.",
        f"Odometry walks at random: {design.odometry.along:g} m along and {design.odometry.across:g} m across after a "
        f"metre, {design.odometry.heading_per_metre:g} rad after a metre, {design.odometry.heading_per_radian:g} rad "
        "after a radian; the filter knows that.",
        f"Objects are lost from {design.blind[0]:g} s to {design.blind[1]:g} s: the filter gets no clusters.",
        "Clusters are found with default settings; k-means chooses their number by the silhouette, the Gaussian "
        "mixture by the Bayesian information criterion (the paper: told, and by the elbow). The filter takes the mean "
        "of a cluster with the covariance of its members, as the paper does, and that of the mean itself; pose and "
        "landmarks are one state. Equations 20 and 24 have wrong signs in print and are used as they must be.",
    ]


def _consistency(result: ClusteringStudy) -> str:
    rows: Sequence[Sequence[str]] = [
        [
            name,
            *(mean(result.error(mode, "anees")[:, :, m].mean(axis=1)).text(2) for mode in MODES),
            mean(result.values(lambda o: o.clusters / o.scans)[:, :, m].mean(axis=1)).text(2),
            mean(result.values(lambda o: float(o.landmarks))[:, :, m].mean(axis=1)).text(1),
        ]
        for m, name in enumerate(NAMES)
    ]
    headers = ("method", *WORDS.values(), "clusters a scan", "landmarks at the end")
    text = (
        "The normalised squared error of the pose over its dimension is 1 on average where the covariance is true, "
        "and more where it claims too much. By odometry alone it should be 1, for the noise is known. With the filter "
        "more is to be expected: the mean of the points on a post of radius r lies about π r / 4 in front of its "
        f"centre ({1e3 * np.pi * result.design.radius / 4:.0f} mm here), on the side of the sensor, and moves around "
        "it as the robot passes. The covariance of the members, which the paper uses, gives each sighting room for "
        "that, but the filter takes errors of successive sightings as independent, and they are not."
    )
    table = reporting.table("Normalised squared error of the pose, and what was found", headers, rows)
    return reporting.paragraphs(text) + table
