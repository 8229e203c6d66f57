"""The sensor's noise: independent Gaussian errors of range and bearing [CWLF 10]."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

Metres = Annotated[float, Field(gt=0, le=1, allow_inf_nan=False, json_schema_extra={"unit": "m"})]
Radians = Annotated[float, Field(gt=0, le=0.05, allow_inf_nan=False, json_schema_extra={"unit": "rad"})]


@dataclass(config=ConfigDict(extra="forbid"), frozen=True, slots=True)
class SensorNoise:
    """Standard deviations of one beam. Both must be positive: no sensor is exact, and weights divide by them."""

    sigma_range: Annotated[Metres, Field(description="standard deviation of a range")] = 0.02
    sigma_bearing: Annotated[Radians, Field(description="standard deviation of a bearing")] = 0.0034

    def point_covariances(
        self, ranges: NDArray[np.float64], bearings: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Covariances of the points (x, y) of beams (N,) in m and rad, sensor frame: (N, 2, 2) m² [CWLF 10]."""
        c, s = np.cos(bearings), np.sin(bearings)
        v_r, v_t = self.sigma_range**2, (ranges * self.sigma_bearing) ** 2
        v_xy = (v_r - v_t) * s * c
        return np.stack(
            [np.stack([v_r * c**2 + v_t * s**2, v_xy], -1), np.stack([v_xy, v_r * s**2 + v_t * c**2], -1)], -2
        )
