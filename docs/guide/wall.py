"""One beam and one wall: the error of a point, and of the lines fitted to many."""

from dataclasses import dataclass

import numpy as np

from lidarcore.evaluation.consistency.design import KINDS
from lidarcore.evaluation.intervals import Interval, ratio
from lidarcore.experiments.corner_study import Method
from lidarcore.geometry import wrap
from lidarcore.lines import FITTERS
from lidarcore.noise import SensorNoise
from lidarcore.scan import Array
from lidarcore.settings import Covariance

from .views import Situation, inside

_INCIDENCE = np.pi / 4  # of the beam that is shown: neither along the wall nor across


@dataclass(frozen=True, eq=False)
class WallView:
    """A wall seen K times, and one of its beams.

    distance     m, range of the beam, and incidence, rad, its angle to the wall's normal
    covariance   (2, 2) m² of the beam's point, in the frame of the wall: along it, and away from the sensor
    points       (K, 2) m, errors of that point
    fits         by fitter (K, 2): errors of (alpha, r), rad and m; claims by fitter and kind (2, 2), typical ones
    """

    noise: SensorNoise
    distance: float
    incidence: float
    covariance: Array
    points: Array
    fits: dict[str, Array]
    claims: dict[Method, Array]

    @property
    def shadow(self) -> float:
        """m, standard deviation of the point's distance from the wall."""
        return float(np.sqrt(self.covariance[1, 1]))

    @property
    def slice(self) -> float:
        """m, the same if the point's place along the wall were known."""
        return float(np.sqrt(1 / np.linalg.inv(self.covariance)[1, 1]))

    @property
    def spread(self) -> Interval:
        """m, RMS distance of the points from the wall."""
        return ratio(self.points[:, 1] ** 2, np.ones(len(self.points))).root()

    def inside(self, fitter: str, kind: Covariance) -> Interval:
        """Share of the lines inside the ellipse claimed for (alpha, r)."""
        return inside(self.fits[fitter], self.claims[fitter, kind])


def wall_view(situation: Situation, fitters: tuple[str, ...], scans: int, seed: int) -> WallView:
    """The first wall of the place, so many times; equal arguments give equal numbers."""
    place, noise = situation.place(), situation.noise
    beams = slice(place.first[0, 0], place.first[0, 0] + place.count[0, 0])
    ranges, bearings = place.ranges[beams], place.bearings[beams]
    rng = np.random.default_rng(seed)
    errors = rng.standard_normal((scans, 2, len(ranges))) * [[noise.sigma_range], [noise.sigma_bearing]]
    rho, theta = ranges + errors[:, 0], bearings + errors[:, 1]
    exact = SensorNoise(1e-6, 1e-6)
    truth = FITTERS["ml"].fit(ranges, bearings, exact)
    incidence = wrap(bearings - truth.alpha)
    beam = int(np.abs(np.abs(incidence) - _INCIDENCE).argmin())
    to_wall = np.array(
        [[-np.sin(truth.alpha), np.cos(truth.alpha)], [np.cos(truth.alpha), np.sin(truth.alpha)]]
    )
    at = ranges[beam] * _unit(bearings[beam])
    points = (rho[:, beam, None] * _unit(theta[:, beam]) - at) @ to_wall.T
    C = noise.point_covariances(ranges[beam : beam + 1], bearings[beam : beam + 1])[0]
    fits, claims = {}, {}
    for name in fitters:
        lines = [FITTERS[name].fit(*scan, noise) for scan in zip(rho, theta, strict=True)]
        fits[name] = np.array([[wrap(line.alpha - truth.alpha), line.r - truth.r] for line in lines])
        for kind in KINDS:
            claims[name, kind] = _typical(np.array([getattr(line, f"covariance_{kind}") for line in lines]))
    return WallView(
        noise, float(ranges[beam]), float(abs(incidence[beam])), to_wall @ C @ to_wall.T, points, fits, claims
    )


def _typical(covariances: Array) -> Array:
    """The one (2, 2) of median area."""
    typical: Array = covariances[np.argsort(np.linalg.det(covariances))[len(covariances) // 2]]
    return typical


def _unit(bearings: Array | float) -> Array:
    return np.stack([np.cos(bearings), np.sin(bearings)], -1)
