"""The noise of a sensor, and the unevenness of walls, from scans it took while it stood still."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from lidarcore.errors import EvaluationError
from lidarcore.evaluation.calibration.profiles import Profile, profiles
from lidarcore.evaluation.calibration.renewal import renewal, resampling
from lidarcore.evaluation.calibration.result import Calibration
from lidarcore.evaluation.calibration.roughness import smooth_or_rough
from lidarcore.evaluation.calibration.systematic import alignment, range_bias, wall_shapes
from lidarcore.evaluation.calibration.unevenness import unevenness
from lidarcore.evaluation.calibration.variances import Bands, variance_model
from lidarcore.evaluation.calibration.wall_beams import WallBeams, beams_on_walls
from lidarcore.evaluation.calibration.white import Scatter, White, tails, white_parts, white_scatter
from lidarcore.evaluation.intervals import Interval, share
from lidarcore.geometry import unit_vectors
from lidarcore.scan import Array, Scan

LEAST_SCANS = 10
BANDS = 4  # of range and of incidence, each with as many beams
LEAST_BINS = 3 * BANDS
STILL = 0.03  # m, a wall that moves more is not seen by a sensor at rest
# m: walls are told apart by their unevenness, which is found from walls; at least as much as usual
_START = 0.004
_PASSES = 4
_ACROSS = 0.1  # parallel walls say nothing of a motion along them
_AGREE = 0.1


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
    good, drift = _at_rest(beams[kept], len(taken))
    scatter = white_scatter(good)
    if len(scatter.dof) < LEAST_BINS:
        raise EvaluationError("Too few beams meet walls: give more scans, or a place with longer walls.")
    white = white_parts(scatter)
    size, length = _unevenness(taken, white)
    sigma_range, growth, sigma_bearing = smooth_or_rough(scatter, white, size, length)
    shapes = wall_shapes(good, white[2].value)
    bias = range_bias(shapes)
    lost, all_ = (np.bincount(beams.scan, x, len(taken)) for x in (~kept, np.ones(len(kept))))
    found = Calibration(
        sigma_range=sigma_range,
        sigma_bearing=sigma_bearing,
        range_growth=growth,
        on_smooth_walls=white,
        unevenness=size,
        unevenness_length=length,
        tails=tails(good, _variance(good, white)),
        renewal=1.0,
        resampling=resampling(taken),
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


def _variance(beams: WallBeams, white: White) -> Array:
    """(N,) m², of each beam's range on its wall."""
    sigma_range, growth, sigma_bearing = (part.value for part in white)
    variance: Array = sigma_range**2 + growth**2 * beams.ranges**4 + sigma_bearing**2 * beams.lever**2 + 1e-12
    return variance


def _unevenness(scans: list[Scan], white: White) -> tuple[Interval, Interval | None]:
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


def _profiles(scans: list[Scan], assumed: float, white: White) -> list[Profile]:
    beams = beams_on_walls(scans, assumed)
    good, _ = _at_rest(beams[beams.near()], len(scans))
    return list(profiles(good, _variance(good, white)))


def _at_rest(beams: WallBeams, scans: int) -> tuple[WallBeams, float]:
    """Beams on walls that stay where they are, and how far (m) the one that moved most of these did so.

    A door moves alone, and so does a wall that a person walks past. Raises EvaluationError if the sensor may have
    moved: if no others stay that would have moved with it, with at least half as many beams.
    """
    walls, first, of, on = np.unique(beams.wall, return_index=True, return_inverse=True, return_counts=True)
    shifts = np.array([_shift(beams[beams.wall == wall], scans) for wall in walls])
    moved = np.abs(shifts) > STILL
    if moved.any():
        normals = unit_vectors(beams.alpha[first])
        by_sensor = normals @ np.linalg.lstsq(normals[moved], shifts[moved], rcond=_ACROSS)[0]
        stayed = ~moved & (np.abs(by_sensor) > STILL)
        if 2 * on[stayed].sum() < on[moved].sum():
            raise EvaluationError(
                f"A wall moved by {1e3 * np.abs(shifts).max():.0f} mm from the first scans to the last: calibration "
                "needs a sensor that stands still, and walls that do."
            )
    still = beams[~moved[of]]
    numbered = np.unique(still.bin, return_inverse=True)[1].astype(np.int64)
    return replace(still, bin=numbered), float(np.abs(shifts[~moved]).max())


def _shift(wall: WallBeams, scans: int) -> float:
    """How far (m) one wall went away from the first third of the scans to the last; 0 if it was not seen in both."""
    early, late = wall.scan < scans // 3, wall.scan >= scans - scans // 3
    if not (early.any() and late.any()):
        return 0.0
    off = np.cos(wall.incidence) * wall.error
    return float(np.median(off[late]) - np.median(off[early]))
