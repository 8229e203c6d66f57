"""A recording with reference poses is mapped, and the map is judged by them."""

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import psutil

from lidarcore.arrays import Array, Ints
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.maps.accuracy import (
    Relations,
    close_pairs,
    reference_poses,
    relation_errors,
    relative_errors,
    with_poor_odometry,
)
from lidarcore.geometry import (
    UncertainPose,
    pose_difference,
    relative,
    relative_jacobians,
    squared_mahalanobis,
)
from lidarcore.mapping import Loop, Mapper, MapperSettings
from lidarcore.mapping.grid.occupancy import Mask
from lidarcore.scan import Scan

ODOMETRY = ("auto", "recorded", "poor", "none")
_WRONG, _WRONG_TURN = 0.5, 0.2  # m and rad by which a pose, or a loop that was believed, is wrong
_SAMPLE = 500  # pairs of keyframes whose joint covariance is computed


@dataclass(frozen=True, slots=True, eq=False)
class MapStudy:
    """What a map is worth.

    scans, tracked, keyframes, loops, wrong  counts; wrong is of loops that were believed, None without a reference
    seconds, megabytes                       of processor time, and the process's largest memory
    pairs       (M,) m and rad errors (M, 2) of relative poses, within 3 m and more than 30 scans apart
    normalised  (S,) squared errors of pairs of keyframes in units of their claimed covariance, 3 dof
    allowed     (S,) the same, the reference being allowed its own error
    live        (N,) squared errors of poses as each scan was placed when it came, by the reference, in units of the
                covariances claimed then, 3 dof; seen from the first scan
    live_by_map
                (N,) the same by the finished map
    given       number of relations verified by hand that were to be looked at
    relations   (R, 3) m and rad errors of those of them that are of this time, and s from their stamps to the next scan
    of_reference
                (R, 3) the same of the reference poses, (0, 3) without them
    """

    scans: int
    tracked: int
    keyframes: int
    loops: int
    wrong: int | None
    seconds: float
    megabytes: float
    pairs: Array
    normalised: Array
    allowed: Array
    live: Array
    live_by_map: Array
    given: int
    relations: Array
    of_reference: Array


def prepared(scans: list[Scan], odometry: str, seed: int) -> tuple[list[Scan], Array | None]:
    """Scans by their stamps with the odometry asked for, and reference poses (N, 3) if there are any.

    recorded takes the log's own, poor makes that of a poor robot from the reference, none leaves it out; auto is
    recorded where the log has a reference besides, else poor.
    Raises EvaluationError if the log's odometry is all the reference there is, or it has none that is asked for.
    """
    if odometry not in ODOMETRY:
        raise EvaluationError(f"There is no odometry {odometry!r}: choose one of {', '.join(ODOMETRY)}.")
    order = np.argsort([scan.stamp for scan in scans], kind="stable")
    scans = [scans[k] for k in order]
    try:
        reference, stands_in = reference_poses(scans)
    except EvaluationError:
        if odometry == "poor":
            raise
        reference, stands_in = None, False
    if odometry == "recorded" and stands_in:
        raise EvaluationError(
            "The log's odometry is all the reference there is: choose poor odometry, or none."
        )
    if odometry == "recorded" and all(scan.odometry is None for scan in scans):
        others = "auto or none" if reference is None else "auto, none, or poor"
        raise EvaluationError(f"The recording has no odometry: choose {others}.")
    if reference is not None and is_drawn(scans, odometry):
        return with_poor_odometry(scans, reference, seed), reference
    return ([replace(scan, odometry=None) for scan in scans] if odometry == "none" else scans), reference


def is_drawn(scans: list[Scan], odometry: str) -> bool:
    """Whether `prepared` gives odometry with errors that are drawn: only then another seed is another run."""
    try:
        _, stands_in = reference_poses(scans)
    except EvaluationError:
        return False
    return odometry == "poor" or (odometry == "auto" and stands_in)


def study(
    scans: list[Scan],
    reference: Array | None,
    settings: MapperSettings,
    relations: Relations | None = None,
    own: tuple[float, float] = (0.02, 0.005),
    progress: Callable[[int], None] = lambda number: None,
) -> MapStudy:
    """Map the scans and judge the map. own is the standard deviation of the reference's poses themselves, m and rad."""
    began, mapper, tracked, came = time.process_time(), Mapper(settings), 0, list[UncertainPose]()
    for number, scan in enumerate(scans, 1):
        tracked += mapper.step(scan).connected
        came.append(mapper.here)
        progress(number)
    mapper.finish()
    seconds = time.process_time() - began
    stamps, poses = mapper.trajectory()
    numbers = mapper.keyframes.numbers
    pairs, normalised, allowed, live, wrong = np.empty((0, 2)), *np.empty((3, 0)), None
    if reference is not None:
        pairs = _lengths(relative_errors(poses, reference, close_pairs(reference)))
        normalised, allowed = _normalised(mapper, reference[numbers], own)
        live = _squares(came[1:], relative(reference[0], reference[1:]))
        wrong = wrong_loops(mapper.loops, reference[numbers])
    by_map = _squares(came[1:], poses[1:])
    found, theirs = np.empty((0, 3)), np.empty((0, 3))
    if relations is not None:
        found = relation_errors(relations, stamps, poses)
        if reference is not None:
            theirs = relation_errors(relations, stamps, reference)
    return MapStudy(
        len(scans), tracked, len(numbers), len(mapper.loops), wrong, seconds, _most_megabytes(),
        pairs, normalised, allowed, live, by_map, 0 if relations is None else len(relations.stamps), found, theirs,
    )  # fmt: skip


def _most_megabytes() -> float:
    """The most memory that this process has had."""
    if sys.platform == "win32":
        return float(psutil.Process().memory_info().peak_wset) / 2**20
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)


def _lengths(errors: Array) -> Array:
    return np.stack([np.hypot(errors[:, 0], errors[:, 1]), np.abs(errors[:, 2])], -1)


def _squares(poses: Sequence[UncertainPose], truth: Array) -> Array:
    """Squared errors (N,) of poses in units of their covariances."""
    off = pose_difference(np.array([pose.pose for pose in poses]).reshape(-1, 3), truth)
    return squared_mahalanobis(off, np.array([pose.covariance for pose in poses]).reshape(-1, 3, 3))


def _normalised(mapper: Mapper, reference: Array, own: tuple[float, float]) -> tuple[Array, Array]:
    pairs: Ints = close_pairs(reference)
    pairs = np.random.default_rng(0).permutation(pairs)[:_SAMPLE]
    theirs = np.diag([own[0], own[0], own[1]]) ** 2
    rows = []
    for i, j in pairs:
        found = mapper.relative(i, j)
        off = pose_difference(found.pose, relative(reference[i], reference[j]))
        A, B = relative_jacobians(reference[i], reference[j])
        both = found.covariance + A @ theirs @ A.T + B @ theirs @ B.T
        rows.append([squared_mahalanobis(off, found.covariance), squared_mahalanobis(off, both)])
    table = np.array(rows, np.float64).reshape(-1, 2)
    return table[:, 0], table[:, 1]


def wrong_loops(loops: Sequence[Loop], reference: Array) -> int:
    """How many loops tie keyframes, which truly were at reference (K, 3), more than 0.5 m or 0.2 rad wrongly."""
    ends = np.array([(loop.i, loop.j) for loop in loops], np.int64).reshape(-1, 2)
    said = np.array([loop.pose for loop in loops]).reshape(-1, 3)
    return int(wrong_poses(said, relative(reference[ends[:, 0]], reference[ends[:, 1]])).sum())


def wrong_poses(poses: Array, reference: Array) -> Mask:
    """Which poses (N, 3) are more than 0.5 m or 0.2 rad off."""
    off = pose_difference(poses, reference)
    return (np.hypot(off[:, 0], off[:, 1]) > _WRONG) | (np.abs(off[:, 2]) > _WRONG_TURN)
