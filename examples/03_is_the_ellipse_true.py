"""How often does the 95 % ellipse hold the true corner? In simulation the truth is known, so one can count."""

import numpy as np

from lidarcore import ExtractionSettings, SensorNoise, compare
from lidarcore.simulation import SimulatedSensor, World

CORNERS = np.array([[2.0, 1.5], [-2.0, 1.5], [-2.0, -1.5], [2.0, -1.5]])  # m: a room of 4 x 3 m
NOISE = SensorNoise(0.02, 0.0034)  # 20 mm, 3.4 mrad
CHI2_95 = 5.991  # 95 % of a chi-square law with two degrees of freedom
SCANS = 500

sensor = SimulatedSensor(World(np.stack([CORNERS, np.roll(CORNERS, -1, axis=0)], axis=1)), NOISE)
settings = ExtractionSettings(noise=NOISE)
rng = np.random.default_rng(1)
held: dict[str, list[float]] = {}

for _ in range(SCANS):
    scan, _ = sensor.scan(np.zeros(3), rng)
    for name, features in compare(scan, settings, ("cwlf", "utls", "ml")).items():
        for kind in ("published", "consistent"):
            covariances = getattr(features.corners, f"covariance_{kind}")
            for xy, covariance in zip(features.corners.xy, covariances, strict=True):
                error = xy - CORNERS[np.linalg.norm(CORNERS - xy, axis=1).argmin()]
                inside = error @ np.linalg.solve(covariance, error) <= CHI2_95
                held.setdefault(f"{name}, {kind}", []).append(inside)

for claim, inside in held.items():
    print(f"{claim:18} holds {np.mean(inside):.3f} of {len(inside)} corners; 0.950 is promised")
