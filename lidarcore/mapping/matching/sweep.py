"""How the sensor moved while it took a scan, by what scans say of it.

A revolution takes a tenth of a second. Wheels tell a turn in it to some hundredths of a radian per second, scans
matched to a map far better: so a scan is matched twice, the second time without the motion that the first one found.
"""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.localization.deskewing import deskew
from lidarcore.scan import Scan

PAUSE = 1.0  # s between two scans, from which on their distance says nothing of the speed in the last one
_NO_MOTION = np.zeros(3)
NOTHING = np.zeros((3, 3))


class Sweep:
    """Takes the motion of the sensor out of one scan after another. Velocities (3,) are in m/s, m/s and rad/s.

    covariance  (3, 3) of T_stamp_scan: how far the scan may stand from where the sensor was at its stamp, as its speed
                in the revolution may differ from that since the scan before by as much as it did the time before
    """

    def __init__(self) -> None:
        self.covariance = NOTHING
        self._removed = _NO_MOTION
        self._before: Array | None = None  # velocity in the last scan, if it was found
        self._found: Array | None = None  # in this one

    def begin(self, velocity: Array) -> None:
        """The first scan turned out to be taken at this velocity, which it is without."""
        self._found = self._removed = velocity

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
        self._before, self._found = self._found, None
        velocity = velocity if self._before is None else self._before
        if removed is None and velocity is not None:
            scan = without(scan, velocity)
        self._removed = next((known for known in (removed, velocity) if known is not None), _NO_MOTION)
        return scan

    def correct(self, scan: Scan, found: Array, dt: float) -> Scan:
        """The scan without the motion (3,) that was found since the scan before it, dt > 0 s ago; the same if unknown.

        What is found depends on what was removed: if that is too much by e, the scan lies behind by e times the mean
        time of its beams, and what is found is too little by that over dt. So the motion that would find itself is
        sought, not the one that was found.
        """
        if scan.beam_times is None or not is_swept(scan) or dt > PAUSE:
            return scan
        half = float(np.mean(scan.beam_times))
        velocity = self._removed + (found - self._removed) / (1 + half / dt)
        changed = velocity - (self._removed if self._before is None else self._before)
        scan = without(scan, velocity - self._removed)
        self._removed = self._found = velocity
        self.covariance = np.diag((half * changed) ** 2)
        return scan


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
