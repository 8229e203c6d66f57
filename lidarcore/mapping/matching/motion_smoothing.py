"""How the sensor moved while it took each scan, smoothed over the scans around it once they are there.

When a scan comes, all that is known of its speed is the motion since the one before, which is a revolution old. A cubic
through where the scans around it were taken says what the speed was in its middle, and how it changed.
"""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import compose, relative, rotation
from lidarcore.mapping.matching.sweep import PAUSE, is_swept
from lidarcore.scan import Scan

# Scans that tell the speed: half a revolution after a scan is in their middle.
_AROUND = np.arange(-2, 4)
_SPEED = np.array([10.0, 10.0, 10.0])  # m/s, m/s, rad/s: nothing is known of it before
_ACCELERATION = np.array([0.5, 0.5, 1.0])  # m/s², m/s², rad/s²: usual ones, standard deviation
_STEADY = 0.5  # s, for which an acceleration usually lasts
# Where an acceleration jumps, a cubic shows a speed that is off by this share of what its third derivative makes of the
# time between two scans, squared (root mean square over where it jumps).
_JUMP = 0.25
_ROUNDS = 20


class ScanMotion(NamedTuple):
    """How a scan was deskewed and placed.

    half          s, mean time of its beams after its stamp; 0 if they were taken at once
    velocity      (3,) m/s, m/s, rad/s in the mean time of its beams that was taken out of it
    acceleration  (3,) m/s², m/s², rad/s², likewise
    variances     (3,) of the pose that it was placed at
    sweep         (3, 3) covariance of where it stands, seen from where the sensor was at its stamp
    on            whether what it saw says where
    """

    half: float
    velocity: Array
    acceleration: Array
    variances: Array
    sweep: Array
    on: bool


def half_time(scan: Scan) -> float:
    """Mean time (s) of a scan's beams after its stamp; 0 if it is not known."""
    return float(np.mean(scan.beam_times)) if scan.beam_times is not None and is_swept(scan) else 0.0


def smoothed(stamps: Array, poses: Array, motions: list[ScanMotion]) -> tuple[Array, list[ScanMotion]]:
    """Poses (T, 3) of scans and their motions, with the speeds that the poses around show where they show any.

    A scan from which e too much of its velocity was taken out was placed e times the mean time of its beams behind:
    the velocities that poses show, and the poses, depend on each other.
    """
    h = np.array([one.half for one in motions])[:, None]
    on = np.array([one.on for one in motions])
    removed = np.stack([[*one.velocity, *one.acceleration] for one in motions]).reshape(-1, 2, 3)
    at = np.arange(len(stamps))[:, None] + _AROUND
    there = np.clip(at, 0, len(stamps) - 1)
    since = stamps[there] - stamps[:, None]
    told = (at == there) & on[there] & (np.abs(since) < PAUSE)
    known = on & (h[:, 0] > 0) & (told.sum(axis=1) > 1)
    variances = np.array([one.variances for one in motions])
    variances[0] = variances[min(1, len(motions) - 1)]  # the first scan is the map: others share its errors
    weights, unsure = _estimator(since - h, np.where(told[..., None], variances[there], np.inf))
    now, shown, jerks = poses, removed, np.zeros_like(poses)
    for _ in range(_ROUNDS):
        rates = np.einsum("tdik,tkd->tid", weights, relative(now[:, None], now[there]))
        shown, jerks = _seen_from_within(rates[:, :2], h), rates[:, 2]
        shown = np.where(known[:, None, None], shown, removed)
        v, a = np.moveaxis(removed - shown, 1, 0)
        now = compose(poses, h * v - h**2 / 3 * a)
    lever = np.concatenate([h, -(h**2) / 3], -1)
    spread = np.einsum("ti,tdij,tj->td", lever, unsure, lever)
    spread += (_JUMP * h * jerks * _apart(stamps)[:, None] ** 2) ** 2
    after = [
        one._replace(velocity=shown[k, 0], acceleration=shown[k, 1], sweep=np.diag(spread[k]))
        if known[k]
        else one
        for k, one in enumerate(motions)
    ]
    return now, after


def _estimator(t: Array, variances: Array) -> tuple[Array, Array]:
    """Weights (T, 3, 3, K) that make velocities and two derivatives out of poses (T, K, 3); covariances (T, 3, 2, 2).

    t (T, K) s are times from the one that is asked about; variances (T, K, 3) are of the poses, inf for none. The
    motion is a cubic: how it differs from one, as accelerations do not last, counts as noise that grows with time.
    """
    basis = np.stack([np.ones_like(t), t, t**2 / 2, t**3 / 6], -1)
    beyond = _ACCELERATION / _STEADY**2 * (t**4 / 24)[..., None]
    information = 1 / np.maximum(variances + beyond**2, 1e-12)
    usual = np.stack([np.full(3, 1e3), _SPEED, _ACCELERATION, _ACCELERATION / _STEADY], -1) ** -2.0
    H = np.einsum("tki,tkd,tkj->tdij", basis, information, basis) + usual[:, :, None] * np.eye(4)
    C = np.linalg.inv(H)
    weights = np.einsum("tdij,tkj,tkd->tdik", C, basis, information)
    return weights[:, :, 1:], C[:, :, 1:3, 1:3]


def _apart(stamps: Array) -> Array:
    """Time (T,) s between each scan and the nearer one of its neighbours: a pause says nothing of how speeds change."""
    gaps = np.concatenate([[np.inf], np.diff(stamps), [np.inf]])
    nearer: Array = np.minimum(gaps[1:], gaps[:-1])
    return np.where(np.isfinite(nearer), nearer, 0.0)


def _seen_from_within(rates: Array, h: Array) -> Array:
    """Velocities and accelerations (T, 2, 3), seen from where a scan began, as the sensor has them h (T, 1) s later."""
    v, a = np.moveaxis(rates, 1, 0).copy()
    R = rotation(v[:, 2] * h[:, 0])
    v[:, :2], a[:, :2] = (np.einsum("tji,tj->ti", R, of[:, :2]) for of in (v, a))
    a[:, :2] -= v[:, 2:] * np.stack([-v[:, 1], v[:, 0]], -1)
    return np.stack([v, a], 1)
