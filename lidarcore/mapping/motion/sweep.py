"""How the sensor moved while it took a scan, by what scans say of it.

A revolution takes a tenth of a second. Wheels tell a turn in it to some hundredths of a radian per second, scans
matched to a map far better: so a scan is matched twice, the second time without the motion that the first one found.
"""

from math import sin
from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import compose, relative, rotate_one
from lidarcore.localization.deskewing import deskew
from lidarcore.scan import Scan

PAUSE = 1.0  # s between two scans, from which on their distance says nothing of the speed in the last one
_NO_MOTION = np.zeros(3)
NOTHING = np.zeros((3, 3))


class _Found(NamedTuple):
    """What was found of a scan's motion.

    velocity  (3,) in the mean time of its beams
    mean      (3,) velocity on the way from that time of the scan before, which took `since` s
    grown     (3,) m/s², m/s², rad/s² by which this differs from that on the way before
    """

    velocity: Array
    mean: Array
    since: float
    grown: Array = _NO_MOTION


class Sweep:
    """Takes the motion of the sensor out of one scan after another. Velocities (3,) are in m/s, m/s and rad/s.

    covariance  (3, 3) of T_stamp_scan: how far the scan may stand from where the sensor was at its stamp, as its speed
                in the revolution may differ from what was found by as much as that does from what was foreseen
    """

    def __init__(self) -> None:
        self.covariance = NOTHING
        self._removed = _NO_MOTION
        self._half = self._half_before = 0.0  # s, mean times of the beams of the last scan and the one before
        self._covered = _NO_MOTION  # pose (3,) of the one before in its mean time, seen from where it began
        self._before: _Found | None = None  # the scan before, if it was found
        self._found: _Found | None = None  # the last one

    def begin(self, scan: Scan, velocity: Array) -> None:
        """The first scan turned out to be taken at this velocity, which it is without."""
        self._found, self._removed, self._half = _Found(velocity, velocity, 0.0), velocity, half_time(scan)

    @property
    def removed(self) -> Array:
        """Velocity (3,) that the last scan is without."""
        return self._removed

    def remove(self, scan: Scan, velocity: Array | None, removed: Array | None) -> Scan:
        """The scan as a sensor that stood still would see it, if this one goes on as scans found it in the last one.

        Where they did not, it is taken to move at this velocity, if one is given. Nothing is taken out again where a
        velocity was `removed` before.
        """
        self.covariance = NOTHING
        self._covered = arc_end(self._half * self._removed)
        self._half_before, self._half = self._half, half_time(scan)
        self._before, self._found = self._found, None
        velocity = velocity if self._before is None else self._before.velocity
        if removed is None and velocity is not None:
            scan = without(scan, velocity)
        self._removed = next((known for known in (removed, velocity) if known is not None), _NO_MOTION)
        return scan

    def correct(self, scan: Scan, last: Array, now: Array, dt: float) -> Scan:
        """The scan without the motion that it was found with, at a pose `now` (3,), where the one before it, dt > 0 s
        ago, is at `last` (3,); the same if that tells nothing.

        In the mean time of its beams a scan is where it was found, whatever was taken out of it: the way between two
        such times tells the mean velocity between them, which is that of half-way.
        """
        since = dt + self._half - self._half_before
        if not is_swept(scan) or dt > PAUSE or since <= 0:  # beams in no order of time tell nothing
            return scan
        covered = arc_end(self._half * self._removed)
        mean = along_arc(relative(compose(last, self._covered), compose(now, covered))) / since
        found, foreseen = self._now(mean, since)
        scan = without(scan, found.velocity - self._removed)
        self._removed, self._found = found.velocity, found
        self.covariance = np.diag((self._half * (found.velocity - foreseen)) ** 2)
        return scan

    def _now(self, mean: Array, since: float) -> tuple[_Found, Array]:
        """How a scan was found to move by the mean velocity (3,) on the way to it; and the velocity foreseen for it.

        A velocity goes on changing as it did twice in a row: what changed once, and back, was noise.
        """
        before = self._before
        if before is None:
            return _Found(mean, mean, since), self._removed
        grown = 2 * (mean - before.mean) / (since + before.since)
        goes_on = _smaller(grown, before.grown)
        foreseen = before.velocity + goes_on * since
        told = mean + goes_on * since / 2
        apart = abs(self._half)  # beams may come before the stamp
        velocity = told + (foreseen - told) * apart / (since + apart)
        return _Found(velocity, mean, since, grown), foreseen


def _smaller(a: Array, b: Array) -> Array:
    """The one nearer to zero of each two numbers of (3,) that have the same sign, else zero."""
    return np.where(a * b > 0, np.sign(a) * np.minimum(np.abs(a), np.abs(b)), 0.0)


def arc_end(covered: Array) -> Array:
    """Pose (3,) where an arc ends, of which so much (3,) is covered: m along and across it, rad."""
    x, y, turn = covered.tolist()
    chord = _chord(turn)
    return np.array([*rotate_one(turn / 2, chord * x, chord * y), turn])


def along_arc(end: Array) -> Array:
    """What (3,) of an arc is covered where it ends at a pose (3,): the inverse of `arc_end`."""
    x, y, turn = end.tolist()
    chord = _chord(turn)
    return np.array([*rotate_one(-turn / 2, x / chord, y / chord), turn])


def _chord(turn: float) -> float:
    """Length of the chord beside that of the arc."""
    return sin(turn / 2) / (turn / 2) if turn else 1.0


def elapsed(scan: Scan, before: float) -> float:
    """Time (s) since the scan with the stamp `before`, but no less than the scan itself took.

    Scans that were held up arrive one upon another, with stamps too close together: by these a sensor at rest would be
    metres per second fast.
    """
    took = float(np.ptp(scan.beam_times)) if scan.beam_times is not None and is_swept(scan) else 0.0
    return max(scan.stamp - before, took)


def is_swept(scan: Scan) -> bool:
    """Whether its beams have times."""
    return scan.beam_times is not None and bool(np.isfinite(scan.beam_times).all())


def without(scan: Scan, velocity: Array, acceleration: Array = _NO_MOTION) -> Scan:
    """The scan as a sensor would see it that stood still, if this one moved at a velocity (3,); the same if unknown.

    With an acceleration (3,) m/s², m/s², rad/s², the velocity is the one in the mean time of the beams.
    """
    (v, u, w), (dv, du, dw) = velocity.tolist(), acceleration.tolist()
    return deskew(scan, v, w, u, (dv, dw, du)) if is_swept(scan) else scan


def half_time(scan: Scan) -> float:
    """Mean time (s) of a scan's beams after its stamp; 0 if it is not known."""
    return float(np.mean(scan.beam_times)) if scan.beam_times is not None and is_swept(scan) else 0.0
