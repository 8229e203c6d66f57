"""Find the sensor in a map, without being told where it is: the map is built from the first half of a recording."""

from itertools import islice
from pathlib import Path

import numpy as np

from lidarcore import extract, open_recording
from lidarcore.localization import NavigationSettings, Navigator

DEMO = Path(__file__).parents[1] / "app" / "demo" / "emulated-s1.mcap"
recording = open_recording(DEMO)
half = 60

mapping = Navigator(NavigationSettings(mode="slam"))
for scan in islice(recording, half):
    scan = mapping.deskewed(scan)
    mapping.step(scan, extract(scan))
known = mapping.landmarks.subset(mapping.landmarks.confirmed)

navigator = Navigator(
    NavigationSettings(mode="localize"), known
)  # no pose: it is found from the corners in view
states = []
for scan in islice(recording, half, None):
    scan = navigator.deskewed(scan)
    result = navigator.step(scan, extract(scan))
    states.append(result.state)

x, y, heading = result.estimate.pose
print(
    f"tracking in {states.count('tracking')} of {len(states)} scans, first in scan {states.index('tracking') + 1}"
)
print(f"at the end: x {x:.3f} m, y {y:.3f} m, heading {np.degrees(heading):.1f}°, {result.state}")
