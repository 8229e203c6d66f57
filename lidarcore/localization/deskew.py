"""Takes the distortion out of a scan whose sensor moved and turned while it was measuring."""

from dataclasses import replace

import numpy as np

from lidarcore.errors import LocalizationError
from lidarcore.poses import wrap
from lidarcore.scan import Scan


def deskew(scan: Scan, v: float, w: float) -> Scan:
    """The scan as a sensor would see it that stands where this one was at `stamp`; it needs beam times.

    v m/s ahead and w rad/s, constant during the revolution: each point is carried along the arc that the sensor
    had covered when its beam was measured.
    Raises LocalizationError if the scan has no finite beam times, or v or w is not finite.
    """
    if scan.beam_times is None or not np.isfinite(scan.beam_times).all():
        raise LocalizationError("The scan has no beam times: without them its distortion cannot be removed.")
    if not (np.isfinite(v) and np.isfinite(w)):
        raise LocalizationError(f"The speed is {v} m/s and {w} rad/s: give finite numbers.")
    turned = w * scan.beam_times
    # The chord of the arc of angle a is sin(a / 2) / (a / 2) long and points half-way round the turn.
    moved = v * scan.beam_times * np.sinc(turned / (2 * np.pi)) * np.exp(0.5j * turned)
    points = moved + scan.ranges * np.exp(1j * (scan.bearings + turned))
    bearings = np.where(scan.valid, np.angle(points), wrap(scan.bearings + turned))
    return replace(scan, ranges=np.abs(points), bearings=bearings)
