"""The white noise of beams, from neighbouring bearings in which the pattern of a wall cancels."""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln, ndtr

from lidarcore.arrays import Array, Columns, Ints
from lidarcore.evaluation.calibration.variances import variance_parts
from lidarcore.evaluation.calibration.wall_beams import WallBeams
from lidarcore.evaluation.intervals import Interval

LEAST_PAIRS = 10  # neighbours in a bin
_DOF = 2 / 3  # of a squared difference of neighbours: each beam is in two of them [von Neumann 1941]
_WINSOR = 2.5  # standard deviations: a difference counts for no more
_ROUNDS = 20
_TAILS = np.array([0.0, 0.05, 0.1, 0.15, 0.2, 0.25])  # heavier ones make weights that leave little to walls
# times what is expected: a bin with so much scatter holds a step of the wall, or something moved
_STEPPED = 6.0
_MOST_STEPPED = 0.2  # of the bins
_TELLING = 10.0  # of log-likelihood that heavier tails have to gain
_AROUND = 4  # neighbours on each side whose median a beam is held against

White = tuple[Interval, Interval, Interval]
"""sigma_range (m), range_growth (1/m) and sigma_bearing (rad)."""


@dataclass(frozen=True, slots=True, eq=False)
class Scatter(Columns):
    """Scatter in M bins: variance (M,) m² of white errors, degrees of freedom, means of lever² m², range m and range⁴
    m⁴, and of incidence rad."""

    variances: Array
    dof: Array
    lever2: Array
    ranges: Array
    range4: Array
    incidence: Array


def white_scatter(beams: WallBeams) -> Scatter:
    """Half of the mean squared difference of beams next to each other in bearing, whatever scan they are of.

    Gross differences are cut down (Winsor's variance, unbiased for Gaussians): they are tails, not noise.
    """
    together = np.diff(beams.bin) == 0
    bins = beams.bin[1:][together]
    difference = np.diff(beams.error)[together]
    n = np.bincount(bins, minlength=int(beams.bin.max()) + 1).astype(np.float64)
    enough = n >= LEAST_PAIRS
    v = _winsorised(difference, bins, n)
    count = np.maximum(np.bincount(beams.bin, minlength=len(n)), 1)
    lever2, ranges, range4, incidence = (
        (np.bincount(beams.bin, x, len(n)) / count)[enough]
        for x in (beams.lever**2, beams.ranges, beams.ranges**4, np.abs(beams.incidence))
    )
    return Scatter(v[enough] / 2, _DOF * n[enough], lever2, ranges, range4, incidence)


def white_parts(scatter: Scatter) -> White:
    """sigma_range (m), range_growth (1/m) and sigma_bearing (rad).

    What cannot be told from none is left out of the fit of the others, the growth first: its interval ends where it
    ended before. On a bearing noise that is not there, or a growth, other parts would lean.
    """
    columns = {"range": np.ones(len(scatter.dof)), "growth": scatter.range4, "bearing": scatter.lever2}
    told = dict(zip(columns, _fit(scatter, list(columns.values())), strict=True))
    expected = sum(told[name].value ** 2 * column for name, column in columns.items())
    excess = scatter.variances / np.maximum(expected, 1e-12)
    smooth = excess <= max(_STEPPED, float(np.quantile(excess, 1 - _MOST_STEPPED)))
    if not smooth.all():
        return white_parts(scatter[smooth])
    left_out: dict[str, Interval] = {}
    for name in ("growth", "bearing"):
        if told[name].low <= 0:
            left_out[name] = Interval(0.0, 0.0, told[name].high)
            kept = [key for key in columns if key not in left_out]
            told |= dict(zip(kept, _fit(scatter, [columns[key] for key in kept]), strict=True))
    told |= left_out
    return told["range"], told["growth"], told["bearing"]


def _fit(scatter: Scatter, columns: list[Array]) -> list[Interval]:
    return variance_parts(scatter.variances, scatter.dof, np.column_stack(columns))


def _winsorised(values: Array, bins: Ints, n: Array) -> Array:
    """(B,) variances about 0 of the values in each bin, those beyond _WINSOR standard deviations cut down to that."""
    k = _WINSOR
    density, beyond = np.exp(-k * k / 2) / np.sqrt(2 * np.pi), ndtr(-k)
    share = (
        1 - 2 * beyond - 2 * k * density + 2 * k * k * beyond
    )  # of the variance that is left to a Gaussian
    squares, counts = values**2, np.maximum(n, 1)
    v = np.bincount(bins, squares, len(n)) / counts
    for _ in range(_ROUNDS):
        v = np.bincount(bins, np.minimum(squares, k * k * v[bins]), len(n)) / counts / share
    return v


def tails(beams: WallBeams, variance: Array) -> float:
    """1 over Student's degrees of freedom of white errors with that variance (N,) m², 0 where Gaussians do as well."""
    n = 2 * _AROUND + 1
    if len(beams.error) < 10 * n:
        return 0.0
    windows = np.lib.stride_tricks.sliding_window_view(beams.error, n)
    same = beams.bin[n - 1 :] == beams.bin[: -n + 1]
    others = np.delete(windows[same], _AROUND, axis=1)
    z = (windows[same, _AROUND] - np.median(others, 1)) / np.sqrt(variance[_AROUND:-_AROUND][same])
    if len(z) < 200:
        return 0.0
    best = [max(_student(z, tail, scale) for scale in np.geomspace(0.5, 1.4, 40)) for tail in _TAILS]
    most = int(np.argmax(best))
    return float(_TAILS[most]) if best[most] - best[0] > _TELLING else 0.0


def _student(z: Array, tail: float, scale: float) -> float:
    """Log-likelihood of z as Student's t, or Gaussian where tail is 0."""
    square = (z / scale) ** 2
    if tail == 0:
        return float(-0.5 * square.sum() - len(z) * (np.log(scale) + 0.5 * np.log(2 * np.pi)))
    nu = 1 / tail
    at_zero = gammaln((nu + 1) / 2) - gammaln(nu / 2) - 0.5 * np.log(nu * np.pi) - np.log(scale)
    return float(len(z) * at_zero - (nu + 1) / 2 * np.log1p(square * tail).sum())
