"""Measure the noise of a sensor that stands still, and use it."""

import numpy as np

from lidarcore import ExtractionSettings, SensorNoise, extract
from lidarcore.evaluation.calibration.calibrate import calibrate
from lidarcore.simulation import SimulatedSensor, furnished_room

TRUE = SensorNoise(0.012, 0.0015)  # what we pretend not to know; with a real sensor, record it at rest
sensor, rng = SimulatedSensor(furnished_room(), TRUE), np.random.default_rng(1)
scans = [sensor.scan(np.array([1.0, 0.5, 0.3]), rng)[0] for _ in range(100)]

result = calibrate(scans)
for name, unit, interval, true in (
    ("range", "mm", result.sigma_range, TRUE.sigma_range),
    ("bearing", "mrad", result.sigma_bearing, TRUE.sigma_bearing),
):
    low, value, high = (1000 * x for x in (interval.low, interval.value, interval.high))
    print(f"{name:8} {value:6.2f} {unit:4} (95 %: {low:.2f} to {high:.2f}), in truth {1000 * true:.2f}")

features = extract(scans[0], ExtractionSettings(noise=result.noise))
print(f"{len(features.corners)} corners, their ellipses made from the noise that was measured")
