"""The noise that one scan should show, against simulated scans; and what is said when it is another."""

from itertools import islice

import numpy as np
import pytest

from lidarcore import ExtractionSettings, Scan, SensorNoise, extract
from lidarcore.evaluation.calibration.noise_check import contradiction
from lidarcore.segmentation.noise_expected import noise_expected
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

NOISES = [
    SensorNoise(0.01, 0.001),
    SensorNoise(0.03, 0.0034),
    SensorNoise(0.005, 0.001, range_growth=0.001),
    SensorNoise(0.001, 0.0005, unevenness=0.006, unevenness_length=0.04),
]


@pytest.mark.parametrize("noise", NOISES)
def test_what_is_expected_is_what_is_seen(noise: SensorNoise) -> None:
    """Of twenty scans of a furnished room the median is known to a few percent; the estimate itself is robust."""
    robot = SimulatedRobot(SimulationSettings(world="furnished room", path="standing", noise=noise, seed=3))
    scans = list(islice(robot, 20))
    seen = np.median([extract(scan, ExtractionSettings(noise=noise)).noise_seen for scan in scans])
    expected = np.median([noise_expected(scan, noise) for scan in scans])
    assert seen / expected == pytest.approx(1, abs=0.2)
    assert contradiction(float(seen), float(expected)) is None


def test_a_contradiction_is_told_in_millimetres() -> None:
    assert contradiction(0.01, 0.02) == "Ranges scatter by 10 mm, set to 20."
    assert contradiction(0.05, 0.01) == "Ranges scatter by 50 mm, set to 10."
    assert contradiction(0.018, 0.02) is None


def test_a_scan_that_sees_nothing_contradicts_nothing() -> None:
    empty = Scan(np.full(10, np.nan), np.linspace(-3, 3, 10))
    assert contradiction(0.0, noise_expected(empty, SensorNoise())) is None
