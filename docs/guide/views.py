"""One corner seen again and again: where it comes out, and what each method claims of it."""

from dataclasses import dataclass

import numpy as np

from lidarcore.evaluation.consistency.figures import GATES, LEVELS
from lidarcore.evaluation.consistency.places import Place, look, shared_ends
from lidarcore.evaluation.intervals import LEVEL, Interval, share
from lidarcore.experiments.corner_study import Method, simulated
from lidarcore.experiments.paper_rooms import BEAMS, NOISE
from lidarcore.geometry import contains
from lidarcore.noise import SensorNoise
from lidarcore.scan import Array
from lidarcore.settings import Covariance, ExtractionSettings
from lidarcore.simulation.rooms import rectangular_room

GATE = float(GATES[LEVELS.index(LEVEL)])  # chi-square, 2 degrees of freedom, 95 %
_AT = (
    -0.15,
    0.10,
    0.5,
)  # where the sensor stands: shares of length and width from the middle, and heading, rad
_CORNER = 3  # of the place, clockwise: neither the best for the papers' ellipses, nor the worst


@dataclass(frozen=True, slots=True)
class Situation:
    """A rectangular room, m, and a sensor's noise."""

    length: float
    width: float
    noise: SensorNoise

    @property
    def room(self) -> str:
        """Its name in a study of consistency."""
        return f"{self.length:g}x{self.width:g}"

    def place(self) -> Place:
        """What is seen from the place that the guide looks from."""
        world = rectangular_room(self.length, self.width)
        pose = np.array([_AT[0] * self.length, _AT[1] * self.width, _AT[2]])
        return look(world, shared_ends(world), pose, self.noise, BEAMS, 0.5)


SITUATIONS = {
    "papers": Situation(4.5, 2.5, NOISE),
    "exact": Situation(4.5, 2.5, SensorNoise(0.01, 0.001)),
    "kind": Situation(9.0, 6.0, SensorNoise(0.02, NOISE.sigma_bearing)),
}
"""By name: the small room with the papers' noise, with a better sensor, and a case that is kind to the papers."""


@dataclass(frozen=True, eq=False)
class CornerView:
    """One corner in K scans: dots by fitter (K, 2) m, errors in the sensor frame; at (2,) m is where it truly is.

    claims by fitter and kind (2, 2) m², from the scan that claims the median area.
    """

    at: Array
    dots: dict[str, Array]
    claims: dict[Method, Array]

    def inside(self, fitter: str, kind: Covariance) -> Interval:
        """Share of the dots inside the 95 % ellipse around the truth, as it is drawn."""
        return inside(self.dots[fitter], self.claims[fitter, kind])

    @property
    def distance(self) -> float:
        """m, from the sensor."""
        return float(np.linalg.norm(self.at))


def inside(dots: Array, claim: Array) -> Interval:
    """Share of dots (K, 2) inside the 95 % ellipse of a covariance (2, 2) around 0."""
    within = contains(dots, claim, LEVEL)
    return share(within.astype(np.float64), np.ones(len(within)))


def view(situation: Situation, scans: int, seed: int) -> CornerView:
    """So many scans, segments known; equal arguments give equal numbers."""
    settings = ExtractionSettings(noise=situation.noise)
    study = simulated(situation.place(), "known", settings, scans, [seed])
    return CornerView(
        study.corners[_CORNER],
        {fitter: trials.errors[_CORNER] for (fitter, _), trials in study.trials.items()},
        {method: study.claims(*method)[_CORNER] for method in study.trials},
    )
