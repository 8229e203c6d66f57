"""What repeatability costs, beside the comparison of methods that it is fed with."""

from collections.abc import Iterator, Mapping
from itertools import cycle, islice

from lidarcore.evaluation.repeatability.statistics import WINDOW, Repeatability
from lidarcore.evaluation.speed.extraction import NOISE, Timing, time_calls
from lidarcore.extraction import compare
from lidarcore.features import Features
from lidarcore.settings import ExtractionSettings
from lidarcore.simulation.robot import SimulatedRobot
from lidarcore.simulation.settings import SimulationSettings

LIMIT_US = 10_000.0
"""Limit for a scan and a new summary: a tenth of a core at 10 Hz."""


def time_repeatability(seed: int = 0) -> list[Timing]:
    """Six methods, a full window of 100 scans of the furnished room from one place."""
    robot = SimulatedRobot(
        SimulationSettings(world="furnished room", path="standing", noise=NOISE, seed=seed)
    )
    scans, settings = list(islice(robot, WINDOW)), ExtractionSettings(noise=NOISE)
    found = [compare(scan, settings) for scan in scans]
    study, again = Repeatability(), cycle(found)
    for features in found:
        study.add(features)
    return [
        time_calls(
            "yardstick: compare(), all six fitters", lambda: [compare(s, settings) for s in scans], WINDOW
        ),
        time_calls("Repeatability.add()", lambda: study.add(next(again)), 1),
        time_calls("Repeatability.add() and summary()", lambda: _both(study, again), 1, LIMIT_US),
    ]


def _both(study: Repeatability, found: Iterator[Mapping[str, Features]]) -> None:
    study.add(next(found))
    study.summary()
