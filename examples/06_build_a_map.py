"""SLAM on a recording: where the sensor was, and a map of landmarks in a file."""

import sys
from pathlib import Path

import numpy as np

from lidarcore import extract, open_recording
from lidarcore.landmarks import write_landmarks
from lidarcore.localization import NavigationSettings, Navigator, to_stored

DEMO = Path(__file__).parents[1] / "app" / "demo" / "emulated-s1.mcap"
OUTPUT = Path(sys.argv[1] if len(sys.argv) > 1 else "map.json")

navigator = Navigator(NavigationSettings(mode="slam"))
for scan in open_recording(DEMO):
    scan = navigator.deskewed(scan)  # as if the sensor had stood still during the revolution
    result = navigator.step(scan, extract(scan))

x, y, heading = result.estimate.pose
sigma = 1000 * np.sqrt(np.diag(result.estimate.covariance)[:2])
print(
    f"{result.state}: x {x:.3f} m, y {y:.3f} m, heading {np.degrees(heading):.1f}°, sigma {sigma.round(1)} mm"
)

landmarks = navigator.landmarks
with OUTPUT.open("w", encoding="utf-8", newline="") as file:
    write_landmarks(to_stored(landmarks), file, "json")
print(
    f"{OUTPUT}: {landmarks.confirmed.sum()} landmarks; {(~landmarks.confirmed).sum()} more were seen too rarely"
)
