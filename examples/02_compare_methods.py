"""Six methods on the same scan: where they put a corner, and what they claim about it."""

from pathlib import Path

import numpy as np

from lidarcore import FITTERS, compare, open_recording

DEMO = Path(__file__).parents[1] / "app" / "demo" / "emulated-s1.mcap"

scan = next(iter(open_recording(DEMO)))
by_method = compare(scan)  # segmented once, fitted by each
place = by_method["ml"].corners.xy[0]

print(f"{'method':28} x, y of one corner, m   area of its 1-sigma ellipse, mm²: consistent, published")
for name, features in by_method.items():
    corners = features.corners
    i = np.linalg.norm(corners.xy - place, axis=1).argmin()
    areas = [
        1e6 * np.pi * np.sqrt(np.linalg.det(c[i]))
        for c in (corners.covariance_consistent, corners.covariance_published)
    ]
    x, y = corners.xy[i]
    print(f"{FITTERS[name].title:28} {x:8.4f} {y:8.4f}     {areas[0]:8.1f} {areas[1]:8.1f}")
