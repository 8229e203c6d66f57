"""How the sensor moved while it took each scan, smoothed over the scans around it once they are there.

When a scan comes, all that is known of its speed is the motion since the one before, which is a revolution old. The
scans around it say what the speed was in its middle, and how it changed.
"""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.geometry import compose, inverse, relative, rotate
from lidarcore.mapping.motion.jerk import Drive, estimated, window
from lidarcore.mapping.motion.jerk_fits import Window
from lidarcore.mapping.motion.sweep import PAUSE

_SCANS = 7
"""Scans that tell a speed: as many at an end, where those nearest to it would not tell how steady the drive is.

More make a steady speed truer, and a turn that begins or ends less so.
"""
_MEDIAN = 0.455  # of a square, in units of its variance
_ROUNDS = 3  # a wrong speed shifts scans, from which it is told: a tenth of it comes back
UNTOLD = np.array([np.zeros(3), np.full(3, 1e4)])
"""A velocity of which nothing is known, and variances that say so."""


class ScanMotion(NamedTuple):
    """How a scan was deskewed and placed.

    half          s, mean time of its beams after its stamp; 0 if they were taken at once
    velocity      (3,) m/s, m/s, rad/s in the mean time of its beams that was taken out of it
    acceleration  (3,) m/s², m/s², rad/s², with which the sweep would begin where it began
    variances     (3,) of the pose that it was placed at
    distorted     (2, 3) the same velocity, with its variances, by how the scan is distorted; see `with_distortion`
    own           (3,) of its pose by its own noise alone: its neighbours share the errors of the map they all lie on
    scatter       (3,) of these, what differs from scan to scan
    sweep         (3, 3) covariance of where it stands, seen from where the sensor was at its stamp
    shared        (3, 3) covariance of that with the error of its place, from which its speed is told, too
    shift         (2, 3, 3) that make how far it is misplaced out of what of both was taken out too much
    on            whether what it saw says where
    """

    half: float
    velocity: Array
    acceleration: Array
    variances: Array
    distorted: Array
    own: Array
    scatter: Array
    sweep: Array
    shared: Array
    shift: Array
    on: bool

    def stands(self, kept: Array) -> Array:
        """Covariance that `sweep` adds to a pose that has so much (3,) of the error of its place.

        A speed that is told by the place itself, wrong with it, makes the scan stand farther off, or less far.
        """
        shared = kept * self.shared
        values, V = np.linalg.eigh(self.sweep + shared + shared.T)
        added: Array = (V * np.maximum(values, 0.0)) @ V.T
        return added


def with_distortion(motions: list[ScanMotion], faster: Array) -> list[ScanMotion]:
    """Motions of smoothed scans, to be smoothed once more by how much `faster` (T, 2, 3) the sensor moved than was
    taken out of each, with variances, as the surfaces say that several scans saw.

    If these say otherwise than the places of scans by more than both claim, mostly, surfaces claim too much.
    """
    h = np.array([max(one.half, 1e-6) for one in motions])[:, None]
    spread = np.array([np.diag(one.sweep) for one in motions]) / h**2
    off, doubts = np.swapaxes(faster, 0, 1)
    doubts = doubts * max(1.0, float(np.median(off**2 / (doubts + spread))) / _MEDIAN)
    return [
        one._replace(distorted=np.stack([one.velocity + more, doubt]))
        for one, more, doubt in zip(motions, off, doubts, strict=True)
    ]


def smoothed(stamps: Array, poses: Array, motions: list[ScanMotion]) -> tuple[Array, list[ScanMotion]]:
    """Poses (T, 3) of scans and their motions, with the speeds that the poses around show where they show any.

    Where the sensor was in the mean time of a scan's beams, the scan says whatever motion was taken out of it, but
    for its shift.
    """
    h = np.array([one.half for one in motions])[:, None]
    on = np.array([one.on for one in motions])
    removed = np.stack([[*one.velocity, *one.acceleration] for one in motions]).reshape(-1, 2, 3)
    shift = np.array([one.shift for one in motions])
    there, exist = _beside(stamps)
    since = stamps[there] - stamps[:, None] + h[there, 0] - h
    told = exist & on[there] & (np.abs(since) < PAUSE)
    known = on & (h[:, 0] > 0) & (told.sum(axis=1) > 1)
    if not known.any():
        return poses, motions
    matched = np.array([one.variances for one in motions])
    matched[0] = matched[min(1, len(motions) - 1)]  # the first scan is the map: it was matched with nothing
    variances = np.minimum(matched, [one.own for one in motions])
    distorted = np.array([one.distorted for one in motions])
    laid = compose(poses, _covered(removed, h))

    def around(means: Array, rates: Array) -> Window:
        straight = _unrolled(means, rates[:, 0, 2], stamps + h[:, 0], on)
        return window(told, since, h[:, 0], straight[there] - straight[:, None], variances[there], distorted)

    drive = Drive.of(around(laid, removed))
    means, shown = laid, removed
    for _ in range(_ROUNDS):
        rates, spread, with_place = estimated(around(means, shown), drive)
        shown = np.where(known[:, None, None], rates, removed)
        means = compose(laid, np.einsum("tijk,tik->tj", shift, shown - removed))
    now = np.where(known[:, None], compose(means, inverse(_covered(shown, h))), poses)
    # Of a pose, for each unit by which a speed and an acceleration are taken out too much.
    lever = shift - np.stack([h, -(h**2) / 3], 1)[..., None] * np.eye(3)
    sweeps = np.einsum("tijd,tdik,tkld->tjl", lever, spread, lever)
    shared = np.einsum("tijd,tid->tjd", lever, with_place)
    after = [
        one._replace(
            velocity=shown[k, 0],
            acceleration=shown[k, 1],
            scatter=drive.noise * variances[k],
            sweep=sweeps[k],
            shared=shared[k],
        )
        if known[k]
        else one
        for k, one in enumerate(motions)
    ]
    return now, after


def _beside(stamps: Array) -> tuple[Ints, Bools]:
    """Numbers (T, K) of the scans that tell the speed of each, and which of them exist: none beyond a pause does."""
    runs = np.cumsum(np.append(0, np.diff(stamps) >= PAUSE))
    first, end = np.searchsorted(runs, runs), np.searchsorted(runs, runs, "right")
    begin = np.maximum(np.minimum(np.arange(len(stamps)) - _SCANS // 2, end - _SCANS), first)
    at = begin[:, None] + np.arange(_SCANS)
    return np.minimum(at, len(stamps) - 1), at < end[:, None]


def _unrolled(poses: Array, rates: Array, times: Array, on: Bools) -> Array:
    """Places (T, 3) as if the sensor had not turned, each step as it saw it lie ahead and to the left.

    Else, where it goes round a curve, a steady speed would pass for one that changes. Between poses (T, 3), headings
    follow from times (T,) s and turn rates (T,) rad/s (cubic Hermite). Poses that are not `on` count for nothing.
    """
    k = np.flatnonzero(on)
    steps = relative(poses[k[:-1]], poses[k[1:]])
    mean = steps[:, 2] / 2 - np.diff(times[k]) * np.diff(rates[k]) / 12  # heading on the way
    longer = 1 / np.sinc(steps[:, 2:] / (2 * np.pi))  # an arc than its chord
    ahead = longer * rotate(-mean, steps[:, :2])
    straight = np.zeros(poses.shape)
    straight[k[1:]] = np.cumsum(np.concatenate([ahead, steps[:, 2:]], 1), axis=0)
    return straight


def _covered(rates: Array, h: Array) -> Array:
    """Poses (T, 3), seen from where scans began, where their beams were taken on average.

    rates (T, 2, 3) are velocities and accelerations in their mean time h (T, 1) s.
    """
    moved = h * rates[:, 0] - h**2 / 3 * rates[:, 1]
    return np.concatenate([rotate(moved[:, 2] / 2, moved[:, :2]), moved[:, 2:]], -1)
