"""The noise of surfaces, by what is left of them when poses and lines are adjusted."""

import numpy as np
from scipy.optimize import nnls
from scipy.special import chdtr

from lidarcore.arrays import Array
from lidarcore.mapping.graph.adjustment_cells import Groups
from lidarcore.mapping.graph.cell_lines import Noise

_ALIKE = 0.03  # share by which a variance changes, below which it is the same
_ROUNDS, _STEADY = 20, 1e-6  # in which noise is measured, at most; share by which it changes in the last one
UNMEASURED = Noise(1.0, 0.005**2)
_LARGEST = 9.0  # a group whose squared residual is more than this many times as expected is an outlier
_INNER = float(chdtr(3, _LARGEST) / chdtr(1, _LARGEST))  # times as expected the mean square of the others is


def measured(groups: Groups, keyframes: int) -> Noise:
    """Factor of the noise's variance, and the variance of what a group shares, from their residuals.

    What is usual, if no group tells.
    """
    kept = (groups.left > 0.2) & (groups.near > 0)  # of the others' noise hardly anything is the ranges'
    squares, noise = groups.squares[kept] / groups.left[kept], groups.variances[kept]
    scale, shared, told = 1.0, 0.005**2, 0.0
    for _ in range(_ROUNDS):
        before = scale, shared
        told = _told(groups, scale * groups.variances + shared, told, keyframes)
        expected = scale * noise + shared
        taken = told / (expected + told)
        inner = squares < _LARGEST * expected * (1 - taken)
        if not inner.any():
            break
        # Each square as it is certain, and as much as it says about the poses: those count whose claims matter.
        weights = expected[inner] ** -1.5
        seen = squares / _INNER + taken * expected
        rows = np.stack([noise, np.ones(len(noise)), seen], -1)[inner] * weights[:, None]
        _, R = np.linalg.qr(rows)  # says the same as all the rows
        (scale, shared), _ = nnls(R[:, :2], R[:, 2])
        scale = max(scale, 0.01)
        if np.allclose((scale, shared), before, rtol=_STEADY, atol=0.0):
            break
    return Noise(float(scale), float(shared))


def _told(groups: Groups, expected: Array, told: float, keyframes: int) -> float:
    """Variance to which all others tell where a group lies, better than the one `told` before.

    Of what lines leave, the 3 K unknowns of the poses take 3 K shares: each group moves them as far as it weighs beside
    all the others.
    """
    return float(3 * keyframes / max((groups.left / (expected + told)).sum(), 1e-12))


def is_alike(before: Noise, now: Noise, groups: Groups) -> bool:
    """Whether a group of usual variance has hardly any other noise."""
    usual = float(np.median(groups.variances)) if len(groups.variances) else 1.0
    earlier, later = (one.scale * usual + one.unevenness for one in (before, now))
    return abs(float(np.log(later / earlier))) < _ALIKE
