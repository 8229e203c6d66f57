"""What a calibration says of a sensor and of walls, and which settings follow from it."""

from dataclasses import dataclass, replace

import numpy as np

from lidarcore.evaluation.calibration.unevenness import overlooked, usual
from lidarcore.evaluation.calibration.variances import Bands
from lidarcore.evaluation.calibration.white import White
from lidarcore.evaluation.intervals import Interval
from lidarcore.noise import SensorNoise

PRECISE = 0.15  # of a part: how well it should be known
_BOUNDS = {
    "sigma_range": (1e-4, 1.0),
    "sigma_bearing": (1e-5, 0.05),
    "range_growth": (0.0, 0.1),
    "unevenness": (0.0, 0.1),
    "unevenness_length": (0.005, 2.0),
}


@dataclass(frozen=True, slots=True)
class Calibration:
    """What the scatter from scan to scan says about one beam, and what stays says about walls. Intervals are of 95 %.

    sigma_range        m, nearby
    sigma_bearing      rad
    range_growth       1/m, times range²: what the standard deviation of a range grows by
    on_smooth_walls    these three, if walls are known to be smooth between neighbouring beams; the intervals above hold
                       for rough ones, too
    unevenness         m, standard deviation of walls about straight lines
    unevenness_length  m, over which it is alike; None where there is none
    tails, renewal, resampling   as in SensorNoise
    by_range           sigma_range (m) in bands of range (m)
    by_incidence       sigma_range (m) in bands of the angle (rad) between beam and normal of the wall
    outliers           share of beams farther off than noise explains
    range_bias         m, in every range; None where too few walls show it
    alignment          rad, from the sensor's x axis to the walls: the offset of the bearings if its housing stands
                       square to them; None where no walls are parallel
    drift              m, from the first third of the scans to the last, of the wall that moved most: it adds to
                       sigma_range
    walls, beams       how many it was made of
    scans              how many were taken
    """

    sigma_range: Interval
    sigma_bearing: Interval
    range_growth: Interval
    on_smooth_walls: White
    unevenness: Interval
    unevenness_length: Interval | None
    tails: float
    renewal: float
    resampling: float
    by_range: Bands
    by_incidence: Bands
    outliers: Interval
    range_bias: Interval | None
    alignment: Interval | None
    drift: float
    walls: int
    beams: int
    scans: int

    @property
    def told(self) -> dict[str, float | None]:
        """Parts of SensorNoise as settings take them, or None where the interval begins at 0.

        Such a part cannot be told from none at all, even on smooth walls: its value says nothing, only its upper end
        does. Unevenness and its length are drawn to what rooms have, the more the less is known of them; their
        intervals say what the walls say.
        """
        found: dict[str, float | None] = {
            name: part.value if part.low > 0 else None for name, part in self._white.items()
        } | {"unevenness": None, "unevenness_length": None}
        if self.unevenness_length is not None and self.unevenness.low > 0:
            found["unevenness"], found["unevenness_length"] = usual(self.unevenness, self.unevenness_length)
        return {
            name: None if value is None else min(max(value, _BOUNDS[name][0]), _BOUNDS[name][1])
            for name, value in found.items()
        }

    @property
    def _white(self) -> dict[str, Interval]:
        return dict(zip(("sigma_range", "range_growth", "sigma_bearing"), self.on_smooth_walls, strict=True))

    @property
    def noise(self) -> SensorNoise:
        """The calibrated noise, for the settings of extraction; SensorNoise's default where nothing could be told."""
        return self.noise_or(SensorNoise())

    def noise_or(self, other: SensorNoise) -> SensorNoise:
        """The calibrated noise, with the values of another one, such as that in use, for what could not be told.

        But not more than could have been overlooked. Growth that is not seen is none. Unevenness that is not seen is
        what rooms usually have of as much as could have been overlooked, and none only where no wall was long enough.
        The systematic part is never seen by a sensor at rest.
        """
        told = self.told
        found = {name: value for name, value in told.items() if value is not None}
        for name in ("sigma_range", "sigma_bearing"):
            if told[name] is None:
                least, _ = _BOUNDS[name]
                found[name] = max(min(getattr(other, name), self._white[name].high), least)
        nothing = {"range_growth": 0.0, "unevenness": 0.0}
        if self.unevenness_length is not None and told["unevenness"] is None:
            nothing["unevenness"], nothing["unevenness_length"] = overlooked(self.unevenness)
        repeated = {"tails": self.tails, "renewal": self.renewal, "resampling": self.resampling}
        return replace(other, **(nothing | found | repeated))

    @property
    def scans_needed(self) -> dict[str, int | None]:
        """How many scans it would take to know each part to within 15 %, as far as scans help; None if not told.

        Noise on smooth walls is known better with the root of their number. Unevenness is not: that takes more walls.
        """
        needed: dict[str, int | None] = {}
        for name, part in self._white.items():
            if part.low > 0:
                needed[name] = int(np.ceil(self.scans * (part.half_width / (PRECISE * part.value)) ** 2))
            else:
                needed[name] = None
        return needed
