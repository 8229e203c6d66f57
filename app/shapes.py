"""Geometry of what the scene draws: ellipses, rings, crosses, strokes of digits. Metres, z = 0."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lidarcore import Scan

Array = NDArray[np.float64]

_TURN = np.linspace(0, 2 * np.pi, 33)
CIRCLE = np.stack([np.cos(_TURN), np.sin(_TURN)], -1)  # (33, 2), closed
DISC_VERTICES = np.vstack([np.zeros(3), np.column_stack([CIRCLE[:-1], np.zeros(32)])])
DISC_FACES = np.array([(0, i, i % 32 + 1) for i in range(1, 33)])
CROSS = np.array([[[-1, -1], [1, 1]], [[-1, 1], [1, -1]]], float)
ARROW = np.array([[[-0.7, -0.6], [1, 0]], [[1, 0], [-0.7, 0.6]], [[-0.7, 0.6], [-0.7, -0.6]]])

_STROKES = {  # polylines on a grid of 2 x 4
    "0": ["00 04 24 20 00"],
    "1": ["10 14 03"],
    "2": ["04 24 22 02 00 20"],
    "3": ["04 24 20 00", "02 22"],
    "4": ["04 02 22", "24 20"],
    "5": ["24 04 02 22 20 00"],
    "6": ["24 04 00 20 22 02"],
    "7": ["04 24 10"],
    "8": ["00 04 24 20 00", "02 22"],
    "9": ["00 20 24 04 02 22"],
    "-": ["02 22"],
    "m": ["00 03 23 20", "13 10"],
    " ": [],
}


def lift(xy: Array, z: float = 0.0) -> NDArray[np.float32]:
    """(..., 2) to (..., 3) float32 at the given height."""
    return np.concatenate([xy, np.full((*xy.shape[:-1], 1), z)], -1).astype(np.float32)


def in_world(pose: Array, points: Array) -> Array:
    """Points (..., 2) m of the sensor frame in the world, T_world_sensor (3,)."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    placed: Array = pose[:2] + points @ np.array([[c, s], [-s, c]])
    return placed


def polylines(points: Array) -> Array:
    """(C, P, 2) polylines as (C * (P - 1), 2, 2) separate strokes."""
    return np.stack([points[:, :-1], points[:, 1:]], 2).reshape(-1, 2, 2)


def wedge(start: float, end: float) -> Array:
    """Outline of the sector of the unit circle from one bearing counter-clockwise to the other, rad: (33, 2)."""
    arc = start + np.linspace(0, (end - start) % (2 * np.pi), len(CIRCLE) - 2)
    return np.vstack([np.zeros(2), np.stack([np.cos(arc), np.sin(arc)], -1), np.zeros(2)])


def ellipses(xy: Array, covariance: Array, scale: float) -> tuple[Array, Array, Array]:
    """Half axes (C, 2), angle of the first (C,), outlines (C, 33, 2); covariances (C, 2, 2) at xy (C, 2)."""
    variances, axes = np.linalg.eigh(covariance)
    half = scale * np.sqrt(np.maximum(variances, 0.0))
    outline = xy[:, None] + np.einsum("cij,cj,pj->cpi", axes, half, CIRCLE)
    return half, np.arctan2(axes[:, 1, 0], axes[:, 0, 0]), outline


def about_z(angle: Array) -> NDArray[np.float32]:
    """Rotations about z as quaternions w, x, y, z: (C, 4)."""
    zero = np.zeros_like(angle)
    return np.stack([np.cos(angle / 2), zero, zero, np.sin(angle / 2)], -1).astype(np.float32)


def text(characters: str, at: tuple[float, float], height: float) -> Array:
    """Strokes (S, 2, 2) of a short text that starts at the given lower left corner."""
    strokes = [
        [(x + 3 * i, y) for x, y in stroke]
        for i, character in enumerate(characters)
        for line in _STROKES[character]
        for stroke in pairwise([(int(p[0]), int(p[1])) for p in line.split()])
    ]
    return np.asarray(at) + np.array(strokes).reshape(-1, 2, 2) * (height / 4)


def axis_labels(reach: float, step: int) -> Array:
    """Strokes (S, 2, 2) of metres along x and y, every `step` metres as far as `reach`."""
    height = reach / 45
    ticks = [sign * k * step for k in range(1, int(reach / step) + 1) for sign in (1, -1)]
    labels = [
        text(f"{t} m", at, height)
        for t in ticks
        for at in ((t + height / 3, height / 3), (height / 3, t + height / 3))
    ]
    return np.concatenate(labels) if labels else np.empty((0, 2, 2))


def nice_step(reach: float) -> int:
    """Whole metres between labels, 1, 2 or 5 times a power of ten, at most eight of them along the reach."""
    return next(s for ten in (1, 10, 100, 1000) for s in (ten, 2 * ten, 5 * ten) if reach <= 8 * s)


def beams_between(scan: Scan, first: int, last: int) -> NDArray[np.int64]:
    """Indices of the beams with a return from first to last along the ring, which may pass its end."""
    n = len(scan)
    beams = np.arange(first, last + 1 if last >= first else last + 1 + n) % n
    return beams[scan.valid[beams]]
