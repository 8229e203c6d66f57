"""What a sensor does wrong in every scan: range bias, and how it is turned against the room."""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from lidarcore.evaluation.calibration.wall_beams import WallBeams
from lidarcore.evaluation.intervals import LEVEL, Interval
from lidarcore.scan import Array

LEAST_WALLS = 3
"""Fewer say too little on what differs from wall to wall, so on how well anything is known."""
_LEAST_BINS = 6  # of a wall: three numbers are fitted to them
_PARALLEL = np.radians(5.0)  # walls within this are taken for parallel, or square, to each other


@dataclass(frozen=True, slots=True, eq=False)
class WallShape:
    """The mean over all scans along one wall, in K bins.

    alpha rad, direction of the normal; off (K,) m, from the wall's line along its normal; by_bias, by_r, by_alpha
    (K,) how `off` changes with a constant in the ranges and with the line's r and alpha.
    """

    alpha: float
    off: Array
    by_bias: Array
    by_r: Array
    by_alpha: Array


def wall_shapes(beams: WallBeams, sigma_bearing: float) -> list[WallShape]:
    """Shapes of all walls with enough bins.

    The mean range at a bearing that scatters by sigma_bearing (rad) is too long by the curvature of rho: taken out.
    Off the wall along its normal, not along the beam: walls are uneven in that way, whatever the incidence.
    """
    n, c = np.bincount(beams.bin), np.cos(beams.incidence)
    curved = beams.ranges * (1 + 2 * np.tan(beams.incidence) ** 2) * sigma_bearing**2 / 2
    columns = (beams.alpha, c * (beams.error - curved), c, np.ones(len(c)), -c * beams.lever)
    means = np.array([np.bincount(beams.bin, column) / n for column in columns])
    wall = np.zeros(len(n), np.int64)
    wall[beams.bin] = beams.wall
    shapes = []
    for number in np.unique(wall):
        on = wall == number
        on &= n >= np.median(n[on]) / 2  # at the ends a bin may hold few beams
        if on.sum() >= _LEAST_BINS:
            alpha, *rest = means[:, on]
            shapes.append(WallShape(float(alpha[0]), *rest))
    return shapes


def range_bias(walls: list[WallShape]) -> Interval | None:
    """A constant (m) in all ranges, or None where too few walls show it.

    A wall's range r / cos(incidence) makes a line whatever r and alpha are; with a constant added it is bent, the more
    the wider the incidence. Least squares of the constant and of every wall's r and alpha. A factor in all ranges
    leaves lines straight and is never seen, and walls all bowed the same way look like a constant.
    """
    shown = [_shown(w.off, w.by_bias, np.column_stack([w.by_r, w.by_alpha])) for w in walls]
    return _agreed(np.array(shown).reshape(-1, 2))


def alignment(walls: list[WallShape], bias: float = 0.0) -> Interval | None:
    """The angle (rad, within ± pi / 4) from the sensor's x axis to walls that are parallel or square to each other.

    It is the offset of the bearings if the sensor's housing stands square to these walls: an offset turns the picture
    and nothing else, so it is not seen without something whose direction is known. None where too few walls agree.
    A bias (m) of the ranges is taken out.
    """
    if not walls:
        return None
    shown = [_shown(w.off - bias * w.by_bias, w.by_alpha, w.by_r[:, None]) for w in walls]
    alpha, known = (np.array(shown) + [[wall.alpha, 0.0] for wall in walls]).T
    parallel = np.abs(_quarter(alpha[:, None] - alpha)) < _PARALLEL
    most = int(np.argmax(parallel @ known))
    main = np.column_stack([_quarter(alpha - alpha[most]), known])[parallel[most]]
    turned = _agreed(main)
    if turned is None:
        return None
    value = float(_quarter(alpha[most] + turned.value))
    return Interval(value, value - turned.half_width, value + turned.half_width)


def _quarter(angle: Array) -> Array:
    """An angle (rad) less its quarter turns, within ± pi / 4."""
    return (angle + np.pi / 4) % (np.pi / 2) - np.pi / 4


def _shown(off: Array, slope: Array, others: Array) -> tuple[float, float]:
    """The factor of a slope beside others by least squares, and its information.

    That is 1 over the variance of the factor if what is off has the variance 1 and is of one piece, as a bow is.
    """
    alone = slope - others @ np.linalg.lstsq(others, slope)[0]
    square = float(alone @ alone)
    return float(alone @ off) / square, square / len(off)


def _agreed(shown: Array) -> Interval | None:
    """The mean of what the walls show (W, 2), weighted by information, and how well it is known by how they differ.

    How uneven a wall is, is the same in every scan: more scans do not help, and beams of one wall do not err
    independently. So each wall counts as one, whatever the number of its bins. That walls are about as uneven as each
    other is assumed: what one that knows most of all is off by shows in the others.
    """
    values, information = shown.T
    if len(values) < LEAST_WALLS:
        return None
    weights = information / information.sum()
    value = float(weights @ values)
    dof = len(values) - 1
    error = float(np.sqrt(weights @ (values - value) ** 2 / dof))
    half = float(stdtrit(dof, (1 + LEVEL) / 2)) * error
    return Interval(value, value - half, value + half)
