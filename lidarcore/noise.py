"""The sensor's noise: independent errors of range and bearing [CWLF 10], and what real walls and rooms add to them."""

from functools import lru_cache
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from lidarcore.fields import plainly
from lidarcore.geometry import rotated_covariance

Metres = Annotated[float, Field(gt=0, le=1, allow_inf_nan=False, json_schema_extra={"unit": "m"})]
Radians = Annotated[float, Field(gt=0, le=0.05, allow_inf_nan=False, json_schema_extra={"unit": "rad"})]
Growth = Annotated[float, Field(ge=0, le=0.1, allow_inf_nan=False, json_schema_extra={"unit": "1/m"})]
Deviation = Annotated[float, Field(ge=0, le=0.1, allow_inf_nan=False, json_schema_extra={"unit": "m"})]
Length = Annotated[float, Field(ge=0.005, le=2, allow_inf_nan=False, json_schema_extra={"unit": "m"})]
Tails = Annotated[float, Field(ge=0, le=0.5, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]


class NoiseModel(NamedTuple):
    """The noise as kernels take it.

    v_rho m² and v_theta rad², variances of range and bearing; growth 1/m², v_rho grows by growth rho⁴; v_wall m², the
    variance of walls about straight lines, and length m over which it is alike; renewal, share of it that is another in
    the next scan from the same place, and resampling, how far beams fall elsewhere on the rest; v_systematic m²; tails,
    and by how much robust weights widen the variance of Gaussian errors; latent, whether ml looks for the true
    bearings.
    """

    v_rho: float
    v_theta: float
    growth: float = 0.0
    v_wall: float = 0.0
    length: float = 1.0
    renewal: float = 1.0
    resampling: float = 0.0
    v_systematic: float = 0.0
    tails: float = 0.0
    widened: float = 0.0
    latent: bool = False


@plainly
@dataclass(config=ConfigDict(extra="forbid"), frozen=True, slots=True)
class SensorNoise:
    """Standard deviations of one beam, of the walls it meets and of what stays the same in every scan.

    The first two must be positive: no sensor is exact, and weights divide by them. The others may be 0, which is the
    noise model of the papers: white errors on perfectly straight walls.
    """

    sigma_range: Metres = Field(
        default=0.02, description="standard deviation of a range. More: larger ellipses, fewer splits"
    )
    sigma_bearing: Radians = Field(
        default=0.0034,
        description="standard deviation of a bearing. More: larger ellipses where walls are far or seen at a slant",
    )
    range_growth: Growth = Field(
        default=0.0,
        description="times the square of a range: what its standard deviation grows by. More: far walls count less",
    )
    unevenness: Deviation = Field(
        default=0.0,
        description="standard deviation of a wall's surface from a straight line. More: larger ellipses",
    )
    unevenness_length: Length = Field(
        default=0.08,
        description="distance along a wall over which its unevenness is alike (correlation 1/e). More: long "
        "walls are known less well",
    )
    systematic: Deviation = Field(
        default=0.0,
        description="what a wall is off by in every scan from one place. More: larger ellipses in maps",
    )

    tails: Tails = Field(
        default=0.0,
        description="weight of the tails of errors: 1 over Student's degrees of freedom, 0 for Gaussian. More: "
        "single points that are far off count less",
    )
    renewal: Share = Field(
        default=1.0,
        description="share of the unevenness that changes from scan to scan at the same place: 1 if "
        "nothing of it repeats, 0 if all of it does. More: a standing sensor's corners scatter more",
    )
    resampling: Share = Field(
        default=0.0,
        description="how far beams fall elsewhere on the unevenness that repeats: 1 anywhere between their "
        "neighbours in every revolution, 0 on the same spots. More: a standing sensor's corners scatter more",
    )

    def model(self, latent: bool = False) -> NoiseModel:
        """The noise as kernels take it; latent: whether ml looks for the true bearings."""
        return NoiseModel(
            self.sigma_range**2,
            self.sigma_bearing**2,
            self.range_growth**2,
            self.unevenness**2,
            self.unevenness_length,
            self.renewal,
            self.resampling,
            self.systematic**2,
            self.tails,
            _widened(self.tails),
            latent,
        )

    def range_variances(self, ranges: NDArray[np.float64]) -> NDArray[np.float64]:
        """Variances m² of ranges (N,) m: sigma_range² + (range_growth rho²)²."""
        return self.sigma_range**2 + (self.range_growth * ranges**2) ** 2

    def point_covariances(
        self, ranges: NDArray[np.float64], bearings: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Covariances of the points (x, y) of beams (N,) in m and rad, sensor frame: (N, 2, 2) m² [CWLF 10].

        Of the beams' own errors: unevenness and the systematic part are the walls'.
        """
        c, s = np.cos(bearings), np.sin(bearings)
        v_r, v_t = self.range_variances(ranges), (ranges * self.sigma_bearing) ** 2
        v_x, v_xy, v_y = rotated_covariance(c, s, v_r, np.zeros_like(v_r), v_t)
        return np.stack([np.stack([v_x, v_xy], -1), np.stack([v_xy, v_y], -1)], -2)


@lru_cache
def _widened(tails: float) -> float:
    """Relative growth of the variance of a Gaussian's location where errors are weighted as Student's.

    E[psi²] / E[psi']² - 1 with psi = z (1 + tails) / (1 + tails z²), by Gauss-Hermite quadrature.
    """
    z, weights = np.polynomial.hermite_e.hermegauss(80)
    psi = z * (1 + tails) / (1 + tails * z**2)
    slope = (1 + tails) * (1 - tails * z**2) / (1 + tails * z**2) ** 2
    return float(weights.sum() * (weights @ psi**2) / (weights @ slope) ** 2 - 1)
