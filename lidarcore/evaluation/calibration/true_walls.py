"""Walls and corners found in a simulated room, against the straight lines that its walls are about."""

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.evaluation.consistency.trials import most_met
from lidarcore.evaluation.intervals import LEVEL
from lidarcore.features import Features
from lidarcore.geometry import act_inverse, contains, unit_vectors, wrap
from lidarcore.simulation.world import World

_LEAST_SINE = 0.1  # between two walls that truly meet; what lies between others is no corner


def held(features: Features, hit: Ints, world: World, pose: Array) -> Array:
    """(2, 2) of walls, and of corners: how many 95 % ellipses of maps hold the truth, and how many there are.

    A segment is of the wall that most of its beams met (hit (N,), of the scan); with none such it is not judged.
    pose (3,) T_world_sensor. A corner is where the lines of its two walls truly meet.
    """
    segments, corners = features.segments, features.corners
    beams = zip(segments.first_beam.tolist(), segments.last_beam.tolist(), strict=True)
    wall = np.array([most_met(hit, first, last) for first, last in beams], np.int64)
    true = _lines(act_inverse(pose, world.walls))[wall]
    lines = segments.lines
    walls = np.column_stack([wrap(lines.alpha - true[:, 0]), lines.r - true[:, 1]])
    within = [contains(walls, lines.covariance_map, LEVEL)[wall >= 0]]
    first, second = true[corners.segments].transpose(1, 0, 2)
    sine = np.sin(second[:, 0] - first[:, 0])
    meet = (wall[corners.segments] >= 0).all(1) & (np.abs(sine) > _LEAST_SINE)
    errors = corners.xy[meet] - _meeting(first[meet], second[meet])
    within.append(contains(errors, corners.covariance_map[meet], LEVEL))
    return np.array([[inside.sum(), len(inside)] for inside in within], np.float64)


def _lines(walls: Array) -> Array:
    """Alpha rad and r >= 0 m (W, 2) of walls (W, 2, 2), sensor frame."""
    along = walls[:, 1] - walls[:, 0]
    normal = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(along[:, 0], along[:, 1])[:, None]
    r = (normal * walls[:, 0]).sum(1)
    away = np.where(r < 0, -1.0, 1.0)
    return np.column_stack([np.arctan2(away * normal[:, 1], away * normal[:, 0]), away * r])


def _meeting(first: Array, second: Array) -> Array:
    """(K, 2) m, where lines (K, 2) meet."""
    lines: Array = np.stack([first, second], 1)
    return np.asarray(np.linalg.solve(unit_vectors(lines[..., 0]), lines[..., 1:])[..., 0], np.float64)
