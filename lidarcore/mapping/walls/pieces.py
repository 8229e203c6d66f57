"""The segments of all keyframes, in the world: what walls are made of."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.extraction import extract
from lidarcore.features import Features
from lidarcore.geometry import act, unit_vectors, wrap
from lidarcore.scan import Scan
from lidarcore.settings import ExtractionSettings

_BEHIND = 0.1  # m that a beam must go beyond a wall's line for the wall to end before it
_NEXT = 2.5  # times the usual angle between beams, within which two are neighbours


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """S segments, each as a keyframe saw it.

    keyframe    (S,) which
    alpha       (S,) rad, direction in the world of the normal that points away from the sensor
    ends        (S, 2, 2) m, first and last point along the ring, world frame
    beyond      (S, 2, 2) m, where the next beam that looks past the segment crosses its line; NaN if none does
    covariance  (S, 2, 2) of the line (alpha, r) as seen from the sensor
    noise_along (S,) m, standard deviation of a point along the line
    position    (S, 2) m, the sensor
    points      (S,) number of returns
    """

    keyframe: Ints
    alpha: Array
    ends: Array
    beyond: Array
    covariance: Array
    noise_along: Array
    position: Array
    points: Ints

    def __len__(self) -> int:
        return len(self.keyframe)


def collect_pieces(scans: Sequence[Scan], poses: Array, settings: ExtractionSettings) -> Pieces:
    """The segments of scans taken at poses (K, 3), T_world_sensor."""
    found = [extract(scan, settings) for scan in scans]
    counts = np.array([len(features.segments) for features in found], np.int64)
    keyframe = np.repeat(np.arange(len(scans)), counts)
    ends = _stacked([_ends(features) for features in found], (2, 2))
    beyond = _stacked([_beyond(features) for features in found], (2, 2))
    alpha = _stacked([features.lines.alpha for features in found], ())
    covariance = _stacked([features.lines.covariance for features in found], (2, 2))
    points = _stacked([features.segments.n_points.astype(np.float64) for features in found], ())
    pose = np.asarray(poses, np.float64).reshape(-1, 3)[keyframe]
    away = np.hypot(*ends.mean(axis=1).T)
    noise = np.sqrt(settings.noise.range_variances(away) + (settings.noise.sigma_bearing * away) ** 2)
    ends, beyond = (act(pose[:, None], xy) for xy in (ends, beyond))
    return Pieces(
        keyframe, alpha + pose[:, 2], ends, beyond, covariance, noise, pose[:, :2], points.astype(np.int64)
    )


def _stacked(parts: list[Array], shape: tuple[int, ...]) -> Array:
    return np.concatenate([np.empty((0, *shape)), *parts])


def _ends(features: Features) -> Array:
    return np.stack([features.segments.start, features.segments.end], 1)


def _beyond(features: Features) -> Array:
    """Where the lines of segments are crossed by the beams before their first and after their last one: (M, 2, 2)."""
    scan, segments, lines = features.scan, features.segments, features.lines
    beams = np.stack([segments.first_beam, segments.last_beam], 1)
    neighbours = (beams + np.array([-1, 1])) % len(scan)
    bearing = scan.bearings[neighbours]
    step = np.abs(wrap(bearing - scan.bearings[beams]))
    across = np.cos(bearing - lines.alpha[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = lines.r[:, None] / across
        past = (
            (across > 0.1) & (scan.ranges[neighbours] > crossing + _BEHIND) & (step < _NEXT * _median(step))
        )
    return np.where(past, crossing, np.nan)[..., None] * unit_vectors(bearing)


def _median(steps: Array) -> float:
    return float(np.median(steps)) if steps.size else 0.0
