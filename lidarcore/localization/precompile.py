"""Compiles the kernels of the filters before anybody waits for them."""

from dataclasses import replace

import numpy as np

from lidarcore.arrays import Array
from lidarcore.extraction import extract
from lidarcore.localization.ekf.slam import ORIGIN
from lidarcore.localization.navigator import Navigator
from lidarcore.localization.points import Points
from lidarcore.localization.settings import NavigationSettings
from lidarcore.scan import Scan

_SCANS, _PERIOD = 8, 0.5  # enough, and long enough, that landmarks are confirmed


def warm_up() -> None:
    """Compile every kernel, or load it from the cache: seconds the first time, so do it before the first scan."""
    bearings = np.linspace(-np.pi, np.pi, 200, endpoint=False)
    ranges = 1 / np.maximum(np.abs(np.cos(bearings)), np.abs(np.sin(bearings)))
    square = Scan(ranges, bearings, beam_times=np.linspace(0, 0.1, 200))
    for odometry in (None, np.zeros(3)):
        built = _run(Navigator(NavigationSettings(mode="slam")), square, odometry)
        _run(Navigator(NavigationSettings(mode="localize"), built.landmarks), square, odometry)
    far = 100.0 + np.stack(np.meshgrid(np.arange(10.0), np.arange(20.0)), -1).reshape(-1, 2)
    large = Points(far, 1e-4 * np.eye(2))
    _run(Navigator(NavigationSettings(mode="slam"), large, np.zeros(3), ORIGIN), square, None)


def _run(navigator: Navigator, scan: Scan, odometry: Array | None) -> Navigator:
    for number in range(_SCANS):
        here = navigator.deskewed(replace(scan, stamp=number * _PERIOD, odometry=odometry))
        navigator.step(here, extract(here))
    return navigator
