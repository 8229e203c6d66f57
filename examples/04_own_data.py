"""Scans from arrays of your own, what was found in them, and why something was not."""

import numpy as np

from lidarcore import ExtractionSettings, Scan, SensorNoise, extract

# A square room of 4 m with a box of 30 cm in it: 720 beams, 5 mm of noise.
bearings = np.linspace(-np.pi, np.pi, 720, endpoint=False)
ranges = 2 / np.maximum(np.abs(np.cos(bearings)), np.abs(np.sin(bearings)))
box = np.abs(bearings) < 0.15
ranges[box] = 1.0 / np.cos(bearings[box])
ranges += np.random.default_rng(1).normal(0, 0.005, len(ranges))
ranges[100:110] = np.nan  # no return

settings = ExtractionSettings(
    noise=SensorNoise(0.005, 0.001), min_length=0.5
)  # the box is too short for this
features = extract(Scan(ranges, bearings), settings)

segments = features.segments
for start, end, length in zip(segments.start, segments.end, segments.length, strict=True):
    print(f"wall from {start.round(2)} to {end.round(2)}, {length:.2f} m")
for rejection in features.rejections:
    print(f"{rejection.kind} at {np.round(rejection.xy, 2)}: {rejection.message}")
