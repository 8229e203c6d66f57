"""Takes the distortion out of a scan whose sensor moved and turned while it was measuring."""

from math import isfinite

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import inlined, kernel
from lidarcore.errors import LocalizationError
from lidarcore.geometry import rotate, rotation
from lidarcore.geometry.kernels import wrap
from lidarcore.localization.dead_reckoning import Velocity
from lidarcore.localization.points import Points
from lidarcore.scan import Scan


class Distortion:
    """What the motion of the sensor did to the newest scan, as far as it was taken out.

    stamp, velocity  of the scan that was deskewed last, NaN if none was, and by what
    """

    def __init__(self) -> None:
        self.stamp = np.nan
        self.velocity: Velocity = (0.0, 0.0, 0.0)

    def remove(self, scan: Scan, velocity: Velocity | None) -> Scan:
        """The scan without it; as it is if the velocity or the times of the beams are not known."""
        if velocity is None or scan.beam_times is None or not np.isfinite(scan.beam_times).all():
            return scan
        self.stamp, self.velocity = scan.stamp, velocity
        return deskew(scan, *velocity)

    def restore(self, points: Points, times: Array, stamp: float) -> Points:
        """Points (K,) of what `remove` gave for the scan of this stamp, as they were seen at times (K,) s after it."""
        return skew(points, times, *self.velocity) if stamp == self.stamp else points


def deskew(scan: Scan, v: float, w: float, u: float = 0.0, acceleration: Velocity = (0.0, 0.0, 0.0)) -> Scan:
    """The scan as a sensor would see it that stands where this one was at `stamp`; it needs beam times.

    v m/s ahead, u m/s to the left and w rad/s, constant during the revolution: each point is carried along the arc
    that the sensor had covered when its beam was measured. With an acceleration (m/s², rad/s², m/s² of v, w, u) they
    are the speeds in the mean time of the beams.
    Raises LocalizationError if the scan has no finite beam times, or a speed is not finite; ScanError if the sensor
    turned farther than numbers go.
    """
    if scan.beam_times is None or not np.isfinite(scan.beam_times).all():
        raise LocalizationError("The scan has no beam times: without them its distortion cannot be removed.")
    if not all(map(isfinite, (v, w, u, *acceleration))):
        raise LocalizationError(f"The speed is {v} and {u} m/s and {w} rad/s: give finite numbers.")
    ranges, bearings = _carried(scan.ranges, scan.bearings, scan.beam_times, (v, w, u), acceleration)
    return scan.with_beams(ranges, bearings)


def skew(points: Points, times: Array, v: float, w: float, u: float) -> Points:
    """Points (K,) of a deskewed scan as the sensor saw them at times (K,) s after the stamp, from where it was then."""
    moved, turned = _arcs(times, v, w, u)
    R = rotation(-turned)
    return points.with_new(rotate(-turned, points.xy - moved), R @ points.covariance @ R.transpose(0, 2, 1))


@kernel
def _carried(
    ranges: Array, bearings: Array, times: Array, speeds: Velocity, growth: Velocity
) -> tuple[Array, Array]:
    """Ranges and bearings (N,) of beams measured at times (N,) s on the way, as seen from its beginning."""
    (v, w, u), (dv, dw, du), mean = speeds, growth, np.mean(times)
    carried, seen_at = np.empty_like(ranges), np.empty_like(bearings)
    for k in range(len(times)):
        x, y, turned = _arc(times[k], v, w, u)
        bend = times[k] * (times[k] / 2 - mean)
        bearing = bearings[k] + turned + dw * bend
        x += dv * bend + ranges[k] * np.cos(bearing)
        y += du * bend + ranges[k] * np.sin(bearing)
        carried[k] = np.sqrt(x * x + y * y)
        if 0 < carried[k] < np.inf:
            seen_at[k] = np.arctan2(y, x)
        else:  # no return, or carried farther than numbers go
            carried[k], seen_at[k] = np.nan, wrap(bearing)
    return carried, seen_at


@kernel
def _arcs(times: Array, v: float, w: float, u: float) -> tuple[Array, Array]:
    """Where the sensor has moved after times (K,) s, (K, 2) m, and the angle it has turned, rad."""
    moved, turned = np.empty((len(times), 2)), np.empty_like(times)
    for k in range(len(times)):
        moved[k, 0], moved[k, 1], turned[k] = _arc(times[k], v, w, u)
    return moved, turned


@inlined
def _arc(t: float, v: float, w: float, u: float) -> tuple[float, float, float]:
    """Where it has moved after t s, x and y in m, and the angle it has turned, rad."""
    half = w * t / 2
    c, s = np.cos(half), np.sin(half)
    # The chord of the arc of angle a is sin(a / 2) / (a / 2) long and points half-way round the turn.
    chord = t * (s / half if half != 0 else 1.0)
    return chord * (c * v - s * u), chord * (s * v + c * u), w * t
