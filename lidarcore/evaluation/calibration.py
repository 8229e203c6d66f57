"""The noise of a sensor from scans it took while it stood still: sigma_range, sigma_bearing, outliers."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from lidarcore.errors import EvaluationError
from lidarcore.evaluation.intervals import Interval, share
from lidarcore.evaluation.systematic import alignment, range_bias, wall_shapes
from lidarcore.evaluation.variances import Bands, variance_model
from lidarcore.evaluation.wall_beams import WallBeams, beams_on_walls
from lidarcore.noise import SensorNoise
from lidarcore.scan import Array, Scan

LEAST_SCANS = 10
BANDS = 4  # of range and of incidence, each with as many beams
LEAST_BINS = 3 * BANDS
STILL = 0.03  # m, a wall that moves more is not seen by a sensor at rest


@dataclass(frozen=True, slots=True)
class Calibration:
    """What the scatter from scan to scan says about one beam. Intervals are of 95 % confidence.

    sigma_range      m, if it is the same everywhere
    sigma_bearing    rad
    by_range         sigma_range (m) in bands of range (m)
    by_incidence     sigma_range (m) in bands of the angle (rad) between beam and normal of the wall
    outliers         share of beams farther off than noise explains
    range_bias       m, in every range; None where too few walls show it
    alignment        rad, from the sensor's x axis to the walls: the offset of the bearings if its housing stands
                     square to them; None where no walls are parallel
    drift            m, from the first third of the scans to the last, of the wall that moved most: it adds to
                     sigma_range
    walls, beams     how many it was made of
    """

    sigma_range: Interval
    sigma_bearing: Interval
    by_range: Bands
    by_incidence: Bands
    outliers: Interval
    range_bias: Interval | None
    alignment: Interval | None
    drift: float
    walls: int
    beams: int

    @property
    def told(self) -> tuple[float | None, float | None]:
        """sigma_range (m) and sigma_bearing (rad) as settings take them, or None where the interval begins at 0.

        Such a sigma cannot be told from none at all: its value says nothing, only its upper end does.
        Within 0.1 mm to 1 m and 0.01 to 50 mrad.
        """
        return _told(self.sigma_range, 1e-4, 1.0), _told(self.sigma_bearing, 1e-5, 0.05)

    @property
    def noise(self) -> SensorNoise:
        """For the settings of extraction: what could be told, and the default of SensorNoise where nothing could."""
        return self.noise_or(SensorNoise())

    def noise_or(self, other: SensorNoise) -> SensorNoise:
        """The same with what another noise says, such as the one in use, where nothing could be told."""
        sigma_range, sigma_bearing = self.told
        return SensorNoise(
            other.sigma_range if sigma_range is None else sigma_range,
            other.sigma_bearing if sigma_bearing is None else sigma_bearing,
        )


def _told(sigma: Interval, least: float, most: float) -> float | None:
    return min(max(sigma.value, least), most) if sigma.low > 0 else None


def calibrate(scans: Iterable[Scan]) -> Calibration:
    """From scans (at least 10, rather 100) of a sensor that stands still before walls.

    On a wall, an error of the bearing acts on the range with the lever rho tan(incidence): the variance of residuals
    is sigma_range² + lever² sigma_bearing². Only what changes from scan to scan counts, not the shape of the wall.
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
    variances, dof, lever2, ranges, incidence = _scatter(good)
    whole = variance_model(variances, dof, lever2, ranges, 1)
    shapes = wall_shapes(good, whole.slope.value)
    bias = range_bias(shapes)
    lost, all_ = (np.bincount(beams.scan, x, len(taken)) for x in (~kept, np.ones(len(kept))))
    return Calibration(
        whole.sigmas[0],
        whole.slope,
        variance_model(variances, dof, lever2, ranges, BANDS),
        variance_model(variances, dof, lever2, incidence, BANDS),
        share(np.asarray(lost, np.float64), np.asarray(all_, np.float64)),
        bias,
        alignment(shapes, 0.0 if bias is None or bias.contains(0) else bias.value),
        drift,
        len(np.unique(good.wall)),
        len(good.error),
    )


def _scatter(beams: WallBeams) -> tuple[Array, Array, Array, Array, Array]:
    """Of each bin with beams enough: variance of the errors, degrees of freedom, means of lever², range, incidence."""
    n = np.bincount(beams.bin).astype(float)
    enough = n >= LEAST_SCANS
    if enough.sum() < LEAST_BINS:
        raise EvaluationError("Too few beams meet walls: give more scans, or a place with longer walls.")
    mean, square, lever2, ranges, incidence = (
        np.bincount(beams.bin, x)[enough] / n[enough]
        for x in (beams.error, beams.error**2, beams.lever**2, beams.ranges, np.abs(beams.incidence))
    )
    dof = n[enough] - 1
    return (square - mean**2) * n[enough] / dof, dof, lever2, ranges, incidence


def _drift(beams: WallBeams, scans: int) -> float:
    """By how much (m) the wall that moved most did so, from the first third of the scans to the last."""
    third = scans // 3
    early, late = beams.scan < third, beams.scan >= scans - third
    moved = [
        abs(float(np.median(beams.error[on & late]) - np.median(beams.error[on & early])))
        for on in (beams.wall == wall for wall in np.unique(beams.wall))
        if (on & early).any() and (on & late).any()
    ]
    return max(moved, default=0.0)
