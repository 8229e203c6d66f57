"""How much farther than told ranges scatter, where noise is not a range's alone."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from lidarcore import SENSORS, ExtractionSettings, Scan, SensorNoise, extract
from lidarcore.localization.observations import Observations
from lidarcore.localization.settings import NavigationSettings
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

RPLIDAR = SENSORS["rplidar_a1_a2"].noise
WALLS = NavigationSettings().filter.unevenness


def scans(noise: SensorNoise) -> list[Scan]:
    simulation = SimulationSettings(world="furnished room", path="standing", noise=noise, seed=5)
    return list(islice(SimulatedRobot(simulation), 20))


def excess(noise: SensorNoise, told: SensorNoise) -> float:
    settings = ExtractionSettings(noise=told)
    return float(np.median([extract(scan, settings).noise_excess for scan in scans(noise)]))


@pytest.mark.parametrize("noise", [RPLIDAR, SensorNoise(0.01, 0.001), SensorNoise(0.001, 0.008)])
def test_noise_that_is_as_told_is_no_excess(noise: SensorNoise) -> None:
    """The ranges of the first and the last one scatter several times as far as their standard deviation at 0 m."""
    assert excess(noise, noise) == pytest.approx(1.0, abs=0.2)


def test_noise_that_is_more_than_told_is_an_excess() -> None:
    told = SensorNoise(0.002, 0.0005, range_growth=0.0003)
    noise = SensorNoise(0.006, 0.0015, range_growth=0.0009)
    assert excess(noise, told) == pytest.approx(3.0, rel=0.2)


def test_a_filter_does_not_doubt_corners_whose_noise_is_told() -> None:
    """They are as sure as their method says, and the filter's own unevenness makes them."""
    scan = replace(scans(RPLIDAR)[0], beam_times=None)
    features = extract(scan, ExtractionSettings(noise=RPLIDAR))
    observed = Observations.of(scan, features, None, NavigationSettings(landmarks="corners")).points
    told = features.corners.covariance_consistent + WALLS**2 * np.eye(2)
    assert len(observed) > 0
    np.testing.assert_array_less(
        np.trace(observed.covariance, axis1=1, axis2=2), 1.5 * np.trace(told, axis1=1, axis2=2)
    )


def test_a_scan_that_sees_nothing_or_what_is_absurdly_far_has_no_excess() -> None:
    for away in (np.nan, 1e200):
        assert extract(Scan(np.full(10, away), np.linspace(-3, 3, 10))).noise_excess == 1.0
