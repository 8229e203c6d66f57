"""What the paper of the experiment claims, beside what was measured."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.clusters import CLUSTERERS
from lidarcore.evaluation.intervals import Interval, mean
from lidarcore.experiments.claim_rules import Claim
from lidarcore.experiments.clustering_ekf import METHODS, ClusteringStudy

_DBSCAN = METHODS.index("dbscan")
_OTHERS = [m for m in range(len(METHODS)) if m != _DBSCAN]
PAPER = -0.05
"""Error with DBSCAN against the others', relative: the paper's conclusion."""


def claims(result: ClusteringStudy) -> list[Claim]:
    """The paper's claims in its order."""
    ms = 1e3 * result.values(lambda o: (o.clustering_s + o.filter_s) / o.scans).mean(axis=(0, 1))
    return [
        _of_time("DBSCAN has the shortest run time.", ms, int(ms.argmin()) == _DBSCAN),
        _of_time("The Gaussian mixture takes the longest.", ms, METHODS[int(ms.argmax())] == "gmm"),
        _five_per_cent(result),
        _least(result),
        _filter_helps(result),
        _recovers(result),
    ]


def _of_time(claim: str, ms: Array, agrees: bool) -> Claim:
    order = ", ".join(f"{CLUSTERERS[METHODS[m]].title} {ms[m]:.2f}" for m in np.argsort(ms))
    return claim, f"ms a scan with the filter, from the fastest: {order}.", agrees


def dbscan_against_others(result: ClusteringStudy) -> Interval:
    """Accumulated error with DBSCAN and the filter over the mean of the other methods', less 1; paired by run."""
    total = result.error("with", "accumulated").sum(axis=1)
    return mean(total[:, _DBSCAN] / total[:, _OTHERS].mean(axis=1) - 1)


def _five_per_cent(result: ClusteringStudy) -> Claim:
    ratio = dbscan_against_others(result)
    agrees = ratio.contains(PAPER)
    return (
        "With DBSCAN the error of the pose is 5 % smaller than with the other methods.",
        f"{ratio.text(1, 100)} % against the mean of the others, all trajectories together.",
        None if agrees and ratio.contains(0) else agrees,
    )


def _least(result: ClusteringStudy) -> Claim:
    total = result.error("with", "accumulated").sum(axis=1)
    best = min(_OTHERS, key=lambda m: float(total[:, m].mean()))
    difference = mean(total[:, _DBSCAN] - total[:, best])
    return (
        "With DBSCAN and the filter the least error accumulates.",
        f"Against {CLUSTERERS[METHODS[best]].title}, the best of the others, {difference.text(2)} m more.",
        None if difference.contains(0) else difference.value < 0,
    )


def _filter_helps(result: ClusteringStudy) -> Claim:
    total = {mode: result.error(mode, "accumulated").sum(axis=1).mean(axis=1) for mode in ("without", "with")}
    ratio = mean(total["with"] / total["without"] - 1)
    return (
        "The filter keeps the error of the odometry from adding up.",
        f"Accumulated error with the filter against without: {ratio.text(0, 100)} %.",
        None if ratio.contains(0) else ratio.value < 0,
    )


def _recovers(result: ClusteringStudy) -> Claim:
    largest = mean(result.error("lost", "largest").mean(axis=(1, 2)))
    final = result.error("lost", "final").mean(axis=(1, 2))
    undisturbed = result.error("with", "final").mean(axis=(1, 2))
    more, nothing = mean(final - undisturbed), largest.value - float(undisturbed.mean())
    return (
        "Where objects are lost the robot leaves its path, and it recovers when it sees them again.",
        f"At its largest the position is {largest.text(0, 1e3)} mm off, "
        f"at the end {mean(final).text(0, 1e3)} mm: {more.text(0, 1e3)} mm more than without the loss.",
        None if more.contains(0) and more.contains(nothing) else more.low <= 0,
    )
