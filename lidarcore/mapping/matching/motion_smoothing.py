"""How the sensor moved while it took each scan, smoothed over the scans around it once they are there.

When a scan comes, all that is known of its speed is the motion since the one before, which is a revolution old. A line
through where the scans around it were taken says what the speed was in its middle.
"""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import compose, relative, rotation
from lidarcore.mapping.matching.sweep import PAUSE, is_swept
from lidarcore.scan import Scan

_AROUND = np.array(
    [-1, 0, 1, 2]
)  # scans that tell the speed: half a revolution after a scan is in their middle
# What a change of acceleration, as second differences of speeds show it, does to such a line: of a motion j t^3 / 6,
# sampled at -3/2, -1/2, 1/2 and 3/2, the line through the outer ones has a slope too large by 0.3 j.
_CUBIC = 0.3
_ROUNDS = 3


class ScanMotion(NamedTuple):
    """How a scan was deskewed and placed.

    half      s, mean time of its beams after its stamp; 0 if they were taken at once
    velocity  (3,) m/s, m/s, rad/s that was taken out of it
    variances (3,) of the pose that it was placed at
    sweep     (3, 3) covariance of where it stands, seen from where the sensor was at its stamp
    on        whether what it saw says where
    """

    half: float
    velocity: Array
    variances: Array
    sweep: Array
    on: bool


def half_time(scan: Scan) -> float:
    """Mean time (s) of a scan's beams after its stamp; 0 if it is not known."""
    return float(np.mean(scan.beam_times)) if scan.beam_times is not None and is_swept(scan) else 0.0


def smoothed(stamps: Array, poses: Array, motions: list[ScanMotion]) -> tuple[Array, list[ScanMotion]]:
    """Poses (T, 3) of scans and their motions, with the velocities that the poses around show where they show any.

    A scan from which e too much of its velocity was taken out was placed e times the mean time of its beams behind:
    the velocities that poses show, and the poses, depend on each other.
    """
    halves, on = np.array([one.half for one in motions]), np.array([one.on for one in motions])
    removed = np.array([one.velocity for one in motions])
    at = np.arange(len(stamps))[:, None] + _AROUND
    there = np.clip(at, 0, len(stamps) - 1)
    t = stamps[there] - stamps[:, None]
    told = (at == there) & on[there] & (np.abs(t) < PAUSE)
    middle = (told * t).sum(axis=1) / np.maximum(told.sum(axis=1), 1)
    known = on & (halves > 0) & (told.sum(axis=1) > 1)
    t = told * (t - middle[:, None])
    slopes = t / np.where(known, (t**2).sum(axis=1), 1.0)[:, None]
    now, v, spreads = poses, removed, np.zeros_like(removed)
    for _ in range(_ROUNDS):
        v = np.einsum("tk,tki->ti", slopes, relative(now[:, None], now[there]))
        v, spreads = _at_half(np.where(known[:, None], v, removed), stamps, middle, halves)
        v = np.where(known[:, None], v, removed)
        now = compose(poses, halves[:, None] * (removed - v))
    noise = np.einsum("tk,tki->ti", slopes**2, np.array([one.variances for one in motions])[there])
    variances = spreads**2 + halves[:, None] ** 2 * noise
    after = [
        one._replace(velocity=v[k], sweep=np.diag(variances[k])) if known[k] else one
        for k, one in enumerate(motions)
    ]
    return now, after


def _at_half(v: Array, stamps: Array, middle: Array, halves: Array) -> tuple[Array, Array]:
    """Velocities (T, 3) of the times `middle` (T,) s after the stamps as they are in the middle of the scans.

    Beside them how far (T, 3) m, m, rad the scans may still stand from where they should: where a speed grows evenly,
    beams lie on average a third of what it grows by in half the scan behind the line. What is added to a speed because
    it is told for another time, as at either end, may be as wrong as it is large.
    """
    acceleration, bend = np.zeros_like(v), np.zeros_like(v)
    if len(v) > 2:
        times = stamps + middle
        apart = np.maximum(times[2:] - times[:-2], 1e-3)
        acceleration[1:-1] = (v[2:] - v[:-2]) / apart[:, None]
        bend[1:-1] = v[2:] - 2 * v[1:-1] + v[:-2]
        for change in (acceleration, bend):
            change[0], change[-1] = change[1], change[-2]
    added = acceleration * (halves - middle)[:, None]
    v = v + added
    v[:, :2] = np.einsum("tji,tj->ti", rotation(v[:, 2] * halves), v[:, :2])  # seen from where it is by then
    unsure = np.stack([acceleration * halves[:, None] / 3, _CUBIC * bend, added])
    spreads: Array = halves[:, None] * np.linalg.norm(unsure, axis=0)
    return v, spreads
