"""What a method claims against what is so: sums over trials, and the figures made of them."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidarcore.arrays import Array, Bools
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.consistency.trials import Trials
from lidarcore.evaluation.intervals import Interval, ratio, share
from lidarcore.geometry import left_of

LEVELS = (0.50, 0.95, 0.99)
GATES = -2 * np.log1p(-np.array(LEVELS))  # quantiles of chi-square with 2 degrees of freedom
Band = tuple[float, float]
Wrong = Literal["too small", "too large"]
Verdict = Literal["true", "too small", "too large", "open"]

HONEST: Band = (0.93, 0.97)  # coverage of a 95 % ellipse that can be believed

# Sums over trials, the columns of a block of results.
SUMS = (
    "trials", "found", "outward", "sideways", "squares", "relative", "pair_products", "pairs",
    "nees", "dimensions", "within_50", "within_95", "within_99", "claimed_area", "actual_area", "repeated",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of merit: what it is, and the two sums of which it is the ratio, or the root of it."""

    name: str
    title: str
    unit: str
    numerator: str
    denominator: str
    kind: Literal["mean", "root", "share"] = "mean"

    def of(self, blocks: Array) -> Interval:
        """The figure with its confidence interval, from independent blocks of sums (B, len(SUMS))."""
        over, under = (blocks[:, SUMS.index(name)] for name in (self.numerator, self.denominator))
        if self.kind == "share":
            return share(over, under)
        return ratio(over, under).root() if self.kind == "root" else ratio(over, under)


FIGURES: dict[str, Figure] = {
    figure.name: figure
    for figure in (
        Figure("found", "share of corners found", "", "found", "trials", "share"),
        Figure("bias", "bias: RMS over places of the mean error", "m", "pair_products", "pairs", "root"),
        Figure("bias_outward", "mean error along the line of sight", "m", "outward", "found"),
        Figure("bias_sideways", "mean error across the line of sight, to the left", "m", "sideways", "found"),
        Figure("rms", "RMS error", "m", "squares", "found", "root"),
        Figure("rms_ratio", "RMS error / Cramér-Rao bound", "", "relative", "found", "root"),
        Figure("coverage_50", "coverage of the 50 % ellipse", "", "within_50", "found", "share"),
        Figure("coverage_95", "coverage of the 95 % ellipse", "", "within_95", "found", "share"),
        Figure("coverage_99", "coverage of the 99 % ellipse", "", "within_99", "found", "share"),
        Figure("anees", "ANEES", "", "nees", "dimensions"),
        Figure("claimed_area", "claimed ellipse area / that of the bound", "", "claimed_area", "repeated"),
        Figure("actual_area", "actual ellipse area / that of the bound", "", "actual_area", "repeated"),
        Figure("area_ratio", "claimed / actual ellipse area", "", "claimed_area", "actual_area"),
    )
}


def wrong(coverage: Interval, honest: Band) -> Wrong | None:
    """What ellipses are whose coverage surely lies outside a band: the whole interval does."""
    if coverage.high < honest[0]:
        return "too small"
    return "too large" if coverage.low > honest[1] else None


def within(coverage: Interval, band: Band) -> bool:
    """Whether the coverage surely lies in a band: the whole interval does."""
    return band[0] <= coverage.low and coverage.high <= band[1]


def tally(trials: Trials) -> Array:
    """The sums (len(SUMS),) over trials.

    Bias: of K scans from one place, products of different scans' errors have the mean error's square for mean.
    Area: with S the sum of e e^T over m scans, root(det S) / (m - 1) has the mean root(det C) if errors are Gaussian
    with second moment C (Wishart, m degrees of freedom). Both are without bias however few the scans of a place are.
    Raises EvaluationError for a covariance that is not positive definite.
    """
    e = trials.errors
    found: Bools = np.isfinite(e[..., 0])  # (P, K)
    e = np.where(found[..., None], e, 0.0)
    nees, claimed = _claims(e, trials.covariances, found)
    squares, m = (e**2).sum(-1), found.sum(1)
    sight = trials.corners / np.linalg.norm(trials.corners, axis=1, keepdims=True)
    bound = np.sqrt(np.linalg.det(trials.bounds))
    repeated = m > 1
    scatter = np.maximum(np.linalg.det(np.einsum("pki,pkj->pij", e, e)), 0.0)
    actual = np.sqrt(scatter[repeated]) / (m[repeated] - 1)
    return np.array(
        [
            found.size,
            found.sum(),
            np.einsum("pki,pi->", e, sight),
            np.einsum("pki,pi->", e, left_of(sight)),
            squares.sum(),
            (squares.sum(1) / np.trace(trials.bounds, axis1=1, axis2=2)).sum(),
            ((e.sum(1) ** 2).sum(-1) - squares.sum(1)).sum(),
            (m * (m - 1)).sum(),
            nees[found].sum(),
            2 * found.sum(),
            *((nees <= gate)[found].sum() for gate in GATES),
            (claimed.sum(1) / bound)[repeated].sum(),
            (actual * m[repeated] / bound[repeated]).sum(),
            m[repeated].sum(),
        ],
        np.float64,
    )


def _claims(e: Array, covariances: Array, found: Bools) -> tuple[Array, Array]:
    """e^T C^-1 e and root(det C) (P, K) of what was found, 0 elsewhere."""
    xx, xy, yy = covariances[..., 0, 0], covariances[..., 0, 1], covariances[..., 1, 1]
    det = xx * yy - xy * xy
    if not ((xx > 0) & (det > 0) & (det < np.inf))[found].all():
        raise EvaluationError("A claimed covariance is not positive definite: it has no ellipse to judge.")
    x, y = e[..., 0], e[..., 1]
    with np.errstate(invalid="ignore"):
        nees = (yy * x * x - 2 * xy * x * y + xx * y * y) / det
        root = np.sqrt(det)
    return np.where(found, nees, 0.0), np.where(found, root, 0.0)
