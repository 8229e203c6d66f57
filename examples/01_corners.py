"""The corners of one scan, each with its standard deviations."""

from pathlib import Path

import numpy as np

from lidarcore import extract, open_recording

DEMO = Path(__file__).parents[1] / "app" / "demo" / "emulated-s1.mcap"

scan = next(iter(open_recording(DEMO)))
features = extract(scan)

print(f"{scan}: {len(features.segments)} walls, {len(features.corners)} corners")
for (x, y), covariance in zip(features.corners.xy, features.corners.covariance, strict=True):
    minor, major = 1000 * np.sqrt(np.linalg.eigvalsh(covariance))
    print(
        f"  corner at {x:6.3f} {y:6.3f} m, sigma {major:4.1f} mm along, {minor:4.1f} mm across its longest axis"
    )
