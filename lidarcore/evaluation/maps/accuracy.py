"""How far the poses of a map are from reference poses, and from relations between scans verified by hand."""

import gzip
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from lidarcore.arrays import Array, Ints
from lidarcore.errors import EvaluationError
from lidarcore.files.reasons import UNPACKING, reason
from lidarcore.geometry import PoseTrack, compose, relative
from lidarcore.scan import Scan

NEAR, APART = 3.0, 30  # m, scans: pairs that show whether a place that is seen again is the same one
_SCALE, _BIAS = 1.03, 0.01  # of a poor robot: ways too long, rad that it turns unnoticed in a metre
_NOISE = np.array([0.05, 0.02, 0.01, 0.03])  # m/√m ahead and aside, rad/√m, rad/√rad


def close_pairs(reference: Array) -> Ints:
    """Pairs (M, 2) i < j of poses (N, 3) less than 3 m from each other and more than 30 scans apart."""
    pairs = cKDTree(reference[:, :2]).query_pairs(NEAR, output_type="ndarray").astype(np.int64)
    pairs = np.sort(pairs, axis=1)
    return pairs[pairs[:, 1] - pairs[:, 0] > APART]


def relative_errors(poses: Array, reference: Array, pairs: Ints) -> Array:
    """Errors (M, 3) m, m, rad of the relative poses T_i_j of pairs (M, 2), seen from where j truly is."""
    i, j = pairs.T
    return relative(relative(reference[i], reference[j]), relative(poses[i], poses[j]))


def reference_poses(scans: list[Scan]) -> tuple[Array, bool]:
    """Poses (N, 3) to compare with, and whether they stand where the log has its odometry.

    They are what a recording declares to be true or corrected: raw odometry is no reference.
    Raises EvaluationError if there are none, or their headings are not known.
    """
    poses = [scan.truth for scan in scans if scan.truth is not None]
    odometry = [scan.odometry for scan in scans if scan.odometry is not None]
    reference = np.array(poses)
    if not np.isfinite(reference).all():
        raise EvaluationError(
            "The recording knows positions but no headings: that is no reference to compare the map with."
        )
    if len(poses) < len(scans):
        raise EvaluationError(
            "The recording has no reference poses, true or corrected ones for all scans: there is nothing to "
            "compare the map with."
        )
    return reference, len(odometry) == len(scans) and np.array_equal(np.array(odometry), reference)


def has_reference(scans: list[Scan]) -> bool:
    """Whether `reference_poses` of these scans are known."""
    try:
        reference_poses(scans)
    except EvaluationError:
        return False
    return True


def name_of_reference(scans: list[Scan]) -> str:
    """What `reference_poses` of these scans are, or why there are none."""
    try:
        _, stand_in = reference_poses(scans)
    except EvaluationError as error:
        return f"none. {error}"
    return "the corrected poses that the log has for odometry" if stand_in else "the true or corrected poses"


def with_poor_odometry(scans: list[Scan], reference: Array, seed: int) -> list[Scan]:
    """The scans with the odometry of a poor robot: 3 % scale, 1 % a metre turn bias, noise."""
    rng, driven, poor = np.random.default_rng(seed), reference[0], []
    for k, scan in enumerate(scans):
        if k:
            step = relative(reference[k - 1], reference[k])
            way = float(np.hypot(*step[:2]))
            ahead, aside, per_metre, per_radian = _NOISE * rng.normal(size=4)
            noise = [
                ahead * np.sqrt(way),
                aside * np.sqrt(way),
                per_metre * np.sqrt(way) + per_radian * np.sqrt(abs(step[2])),
            ]
            driven = compose(driven, step * [_SCALE, _SCALE, 1] + [0, 0, _BIAS * way] + np.array(noise))
        poor.append(replace(scan, odometry=driven))
    return poor


def backwards(scans: list[Scan]) -> list[Scan]:
    """The scans turned around in time: another drive through the same rooms, on which no setting was chosen.

    Stamps are where odometry is known, as before: beams come before them.
    """
    last = max((scan.stamp for scan in scans), default=0.0)
    return [
        replace(
            scan,
            stamp=last - scan.stamp,
            beam_times=None if scan.beam_times is None else -scan.beam_times,
        )
        for scan in reversed(scans)
    ]


@dataclass(frozen=True, slots=True, eq=False)
class Relations:
    """Relative poses T_1_2 (M, 3) between stamps (M, 2) s, verified by hand."""

    stamps: Array
    poses: Array


def read_relations(path: Path) -> Relations:
    """Read a file with rows t1 t2 dx dy dz roll pitch yaw, as the benchmark of Kümmerle et al. 2009 gives them.

    Raises EvaluationError if it is none, OSError if it cannot be read.
    """
    opened = gzip.open if path.suffix == ".gz" else open
    try:
        with opened(path, "rt") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of an empty file, which is refused below
            table = np.loadtxt(file, ndmin=2)
    except (ValueError, EOFError, gzip.BadGzipFile, *UNPACKING) as error:
        why = reason(error).rstrip(".")
        raise EvaluationError(f"{path.name} is not a file of relations: {why}.") from error
    if table.shape[1] != 8 or not np.isfinite(table).all():
        raise EvaluationError(
            f"{path.name} should have eight numbers in each row: t1 t2 dx dy dz roll pitch yaw."
        )
    return Relations(table[:, :2], table[:, [2, 3, 7]])


def relation_errors(relations: Relations, stamps: Array, poses: Array, gap: float = 1.0) -> Array:
    """Errors (M, 3) of the relations whose stamps lie between poses (N, 3) less than `gap` s apart.

    m and rad, and s from the farther one of both stamps to the next pose: farther away, they are mostly those of
    interpolating a motion that was not even.
    """
    track, errors = PoseTrack(stamps, poses), []
    sorted_stamps = np.sort(stamps)
    for (first, second), known_to_be in zip(relations.stamps, relations.poses, strict=True):
        a, b = (track.at(t) if _covered(sorted_stamps, t, gap) else None for t in (first, second))
        if a is not None and b is not None:
            off = relative(known_to_be, relative(a, b))
            away = max(float(np.abs(sorted_stamps - t).min()) for t in (first, second))
            errors.append([np.hypot(off[0], off[1]), abs(off[2]), away])
    return np.array(errors).reshape(-1, 3)


def _covered(stamps: Array, t: float, gap: float) -> bool:
    """True if t is a stamp (a file may round it to microseconds), or between two less than `gap` apart."""
    k = int(np.searchsorted(stamps, t))
    near = stamps[max(k - 1, 0) : k + 1]
    if len(near) and np.abs(near - t).min() < 1e-5:
        return True
    return len(near) == 2 and float(np.ptp(near)) < gap
