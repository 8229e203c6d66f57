"""The noise of a sensor, and the unevenness of walls, from scans it took while it stood still."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from lidarcore.errors import EvaluationError
from lidarcore.evaluation.calibration.renewal import renewal, resampling
from lidarcore.evaluation.calibration.systematic import alignment, range_bias, wall_shapes
from lidarcore.evaluation.calibration.unevenness import Profile, profiles, unevenness, usual
from lidarcore.evaluation.calibration.variances import Bands, variance_model
from lidarcore.evaluation.calibration.wall_beams import WallBeams, beams_on_walls
from lidarcore.evaluation.calibration.white import Scatter, tails, white_parts, white_scatter
from lidarcore.evaluation.intervals import Interval, share
from lidarcore.noise import SensorNoise
from lidarcore.scan import Array, Scan

LEAST_SCANS = 10
BANDS = 4  # of range and of incidence, each with as many beams
LEAST_BINS = 3 * BANDS
STILL = 0.03  # m, a wall that moves more is not seen by a sensor at rest
PRECISE = 0.15  # of a part: how well it should be known
_START = (
    0.004  # m: walls are told apart by their unevenness, which is found from walls; at least as much as usual
)
_PASSES = 4
_AGREE = 0.1
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

        Such a part cannot be told from none at all: its value says nothing, only its upper end does. Unevenness and its
        length are drawn to what rooms have, the more the less is known of them; their intervals say what the walls say.
        """
        found: dict[str, float | None] = {
            name: part.value if part.low > 0 else None
            for name, part in (
                ("sigma_range", self.sigma_range),
                ("sigma_bearing", self.sigma_bearing),
                ("range_growth", self.range_growth),
            )
        } | {"unevenness": None, "unevenness_length": None}
        if self.unevenness_length is not None and self.unevenness.low > 0:
            found["unevenness"], found["unevenness_length"] = usual(self.unevenness, self.unevenness_length)
        return {
            name: None if value is None else min(max(value, _BOUNDS[name][0]), _BOUNDS[name][1])
            for name, value in found.items()
        }

    @property
    def noise(self) -> SensorNoise:
        """The calibrated noise, for the settings of extraction; SensorNoise's default where nothing could be told."""
        return self.noise_or(SensorNoise())

    def noise_or(self, other: SensorNoise) -> SensorNoise:
        """The calibrated noise, with the values of another one, such as that in use, for what could not be told.

        But not more than could have been overlooked. Growth and unevenness that are not seen are none; the systematic
        part is never seen by a sensor at rest.
        """
        told = self.told
        found = {name: value for name, value in told.items() if value is not None}
        for name, part in (("sigma_range", self.sigma_range), ("sigma_bearing", self.sigma_bearing)):
            if told[name] is None:
                least, _ = _BOUNDS[name]
                found[name] = max(min(getattr(other, name), part.high), least)
        nothing = {"range_growth": 0.0, "unevenness": 0.0}
        repeated = {"tails": self.tails, "renewal": self.renewal, "resampling": self.resampling}
        return replace(other, **(nothing | found | repeated))

    @property
    def scans_needed(self) -> dict[str, int | None]:
        """How many scans it would take to know each part to within 15 %, as far as scans help; None if not told.

        Noise is known better with the root of their number. Unevenness is not: that takes more walls.
        """
        needed: dict[str, int | None] = {}
        for name in ("sigma_range", "sigma_bearing", "range_growth"):
            part: Interval = getattr(self, name)
            if part.low > 0:
                needed[name] = int(np.ceil(self.scans * (part.half_width / (PRECISE * part.value)) ** 2))
            else:
                needed[name] = None
        return needed


def calibrate(scans: Iterable[Scan]) -> Calibration:
    """Calibrate a sensor by scans (at least 10, rather 100) that it took while it stood still before walls.

    On a wall, an error of the bearing acts on the range with the lever rho tan(incidence): the variance of white errors
    is sigma_range² + growth² rho⁴ + lever² sigma_bearing², and differences of neighbouring beams show it, in which the
    shape of the wall cancels. That shape, the same in every scan, tells how uneven walls are.
    Raises EvaluationError if there are too few scans, no walls, or the sensor moved; and if no noise fits the scatter.
    """
    taken = list(scans)
    if len(taken) < LEAST_SCANS:
        raise EvaluationError(
            f"{len(taken)} scans are too few: give at least {LEAST_SCANS} of a sensor at rest."
        )
    beams = beams_on_walls(taken)
    kept = beams.near()
    good = beams[kept]
    drift = _drift(good, len(taken))
    if drift > STILL:
        raise EvaluationError(
            f"A wall moved by {1e3 * drift:.0f} mm from the first scans to the last: calibration needs a sensor that "
            "stands still, and walls that do."
        )
    scatter = white_scatter(good)
    if len(scatter.dof) < LEAST_BINS:
        raise EvaluationError("Too few beams meet walls: give more scans, or a place with longer walls.")
    white = white_parts(scatter)
    size, length = _unevenness(taken, white)
    shapes = wall_shapes(good, white[2].value)
    bias = range_bias(shapes)
    lost, all_ = (np.bincount(beams.scan, x, len(taken)) for x in (~kept, np.ones(len(kept))))
    found = Calibration(
        sigma_range=white[0],
        sigma_bearing=white[2],
        range_growth=white[1],
        unevenness=size,
        unevenness_length=length,
        tails=tails(good, _variance(good, white)),
        renewal=1.0,
        resampling=0.0 if size.low == 0 else resampling(taken),
        by_range=_bands(scatter, scatter.ranges),
        by_incidence=_bands(scatter, scatter.incidence),
        outliers=share(np.asarray(lost, np.float64), np.asarray(all_, np.float64)),
        range_bias=bias,
        alignment=alignment(shapes, 0.0 if bias is None or bias.contains(0) else bias.value),
        drift=drift,
        walls=len(np.unique(good.wall)),
        beams=len(good.error),
        scans=len(taken),
    )
    return replace(found, renewal=renewal(taken, found.noise))


def _bands(scatter: Scatter, by: Array) -> Bands:
    return variance_model(scatter.variances, scatter.dof, scatter.lever2, by, BANDS)


def _variance(beams: WallBeams, white: tuple[Interval, Interval, Interval]) -> Array:
    """(N,) m², of each beam's range on its wall."""
    sigma_range, growth, sigma_bearing = (part.value for part in white)
    variance: Array = sigma_range**2 + growth**2 * beams.ranges**4 + sigma_bearing**2 * beams.lever**2 + 1e-12
    return variance


def _unevenness(
    scans: list[Scan], white: tuple[Interval, Interval, Interval]
) -> tuple[Interval, Interval | None]:
    """Size and length (m), of walls told apart by an unevenness no less than what they show."""
    assumed = _START
    size, length = Interval(0.0, 0.0, 0.0), None
    for _ in range(_PASSES):
        walls = _profiles(scans, assumed, white)
        if not walls:
            return size, length
        size, length = unevenness(walls, np.random.default_rng(0))
        if size.value <= (1 + _AGREE) * assumed:
            break
        assumed = size.value
    return size, length


def _profiles(scans: list[Scan], assumed: float, white: tuple[Interval, Interval, Interval]) -> list[Profile]:
    beams = beams_on_walls(scans, assumed)
    good = beams[beams.near()]
    return list(profiles(good, _variance(good, white)))


def _drift(beams: WallBeams, scans: int) -> float:
    """How far (m) the wall that moved most did so, from the first third of the scans to the last."""
    third = scans // 3
    early, late = beams.scan < third, beams.scan >= scans - third
    moved = [
        abs(float(np.median(beams.error[on & late]) - np.median(beams.error[on & early])))
        for on in (beams.wall == wall for wall in np.unique(beams.wall))
        if (on & early).any() and (on & late).any()
    ]
    return max(moved, default=0.0)
