"""Corners seen again and again from one place: what each method claims of them beside how they scatter."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.consistency.design import KINDS
from lidarcore.evaluation.consistency.places import Place
from lidarcore.evaluation.consistency.trials import Segmentation, Trials, simulate
from lidarcore.evaluation.intervals import LEVEL, Interval, ratio, share
from lidarcore.extraction import compare
from lidarcore.features import Corners
from lidarcore.geometry import contains
from lidarcore.lines import FITTERS
from lidarcore.scan import Scan
from lidarcore.settings import Covariance, ExtractionSettings

LEAST_SCANS = 10
SAME = 0.2  # m, a corner farther than this from where it was in the first scan is another
Method = tuple[str, Covariance]


@dataclass(frozen=True, eq=False)
class CornerStudy:
    """P corners in K scans from one place, in the order of the ring, clockwise; sensor frame.

    trials by fitter and kind of covariance, NaN where a corner was not found. Their errors are from the truth; of a
    recording, which has none, from the mean of what the fitter made of all scans, and `bounds` are None.
    """

    trials: dict[Method, Trials]
    bounds: Array | None

    @property
    def corners(self) -> Array:
        """(P, 2) m."""
        return next(iter(self.trials.values())).corners

    @property
    def scans(self) -> int:
        """How many scans there are."""
        return len(next(iter(self.trials.values())).errors[0])

    def claimed(self, fitter: str, kind: Covariance) -> Array:
        """(P, 2) m, standard deviations of x and y of `claims`."""
        return np.sqrt(np.diagonal(self.claims(fitter, kind), axis1=1, axis2=2))

    def claims(self, fitter: str, kind: Covariance) -> Array:
        """(P, 2, 2) m², covariances as claimed: of each corner from the scan that claims the median area."""
        covariances = self.trials[fitter, kind].covariances
        areas = _areas(covariances)
        found = np.isfinite(areas).sum(1)
        typical = np.argsort(areas, axis=1)[np.arange(len(areas)), (found - 1) // 2]  # NaN come last
        return covariances[np.arange(len(areas)), typical]

    def scatter(self, fitter: str) -> Array:
        """(P, 2) m, RMS error in x and y."""
        return np.sqrt(np.diagonal(self.scattered(fitter), axis1=1, axis2=2))

    @cached_property
    def bound(self) -> Array:
        """(P, 2) m, the least standard deviations of x and y that are possible; NaN for a recording."""
        if self.bounds is None:
            return np.full((len(self.corners), 2), np.nan)
        return np.sqrt(np.diagonal(self.bounds, axis1=1, axis2=2))

    def below_bound(self, fitter: str) -> int:
        """Number of corners whose published ellipse has a smaller area than any honest one can have."""
        assert self.bounds is not None
        areas = np.nanmedian(_areas(self.trials[fitter, "published"].covariances), axis=1)
        return int((areas < _areas(self.bounds)).sum())

    def scan_areas(self, fitter: str, kind: Covariance) -> Array:
        """(K,) m², the median of each scan's one-sigma ellipses, of scans in which every fitter found a corner."""
        areas = _areas(self.trials[fitter, kind].covariances)
        return np.nanmedian(areas[:, self._with_corners], axis=0)

    @cached_property
    def _with_corners(self) -> Bools:
        found = [np.isfinite(trials.errors[..., 0]).any(0) for trials in self.trials.values()]
        return np.all(found, axis=0)

    def scattered(self, fitter: str) -> Array:
        """(P, 2, 2) m², mean square errors: what a true covariance would be."""
        e = self.trials[fitter, "published"].errors
        found = np.isfinite(e[..., 0]).sum(1)
        return np.einsum("pki,pkj->pij", np.nan_to_num(e), np.nan_to_num(e)) / found[:, None, None]

    def actual_area(self, fitter: str) -> float:
        """m², the median over corners of the one-sigma ellipse of the true scatter."""
        return float(np.median(_areas(self.scattered(fitter))))

    def found(self, fitter: str) -> Interval:
        """Share of corners found; the interval takes scans as independent, as all below do."""
        found = np.isfinite(self.trials[fitter, "published"].errors[..., 0])
        return share(found.sum(0).astype(float), np.full(self.scans, float(len(found))))

    def coverage(self, fitter: str, kind: Covariance) -> Interval:
        """Share of the true corners inside the 95 % ellipse claimed."""
        trials = self.trials[fitter, kind]
        found = np.isfinite(trials.errors[..., 0])
        e, c = trials.errors[found], trials.covariances[found]
        within = np.zeros(found.shape)
        within[found] = contains(e, c, LEVEL)
        return share(within.sum(0), found.sum(0).astype(float))

    def bias(self, fitter: str) -> float:
        """RMS over corners of the mean error, over the RMS error; of a recording 0, for its errors are from means."""
        e = self.trials[fitter, "published"].errors
        return float(np.sqrt((np.nanmean(e, axis=1) ** 2).sum() / np.nanmean(e**2, axis=1).sum()))

    def rms_ratio(self, fitter: str, other: str) -> Interval:
        """RMS error by one fitter over that by another, of the corners both found."""
        e, f = (self.trials[name, "published"].errors for name in (fitter, other))
        both = np.isfinite(e[..., 0] + f[..., 0])[..., None]
        return ratio(*((np.where(both, x, 0.0) ** 2).sum((0, 2)) for x in (e, f))).root()

    def claimed_ratios(self, fitter: str, other: str) -> tuple[Interval, Interval]:
        """Mean published standard deviations of x and of y by one fitter over those by another, all scans together."""
        one, two = (
            np.sqrt(np.diagonal(self.trials[name, "published"].covariances, axis1=2, axis2=3))
            for name in (fitter, other)
        )
        both = np.isfinite(one + two)
        sums = [np.where(both, sigmas, 0.0).sum(0) for sigmas in (one, two)]
        return ratio(sums[0][:, 0], sums[1][:, 0]), ratio(sums[0][:, 1], sums[1][:, 1])

    def apart(self, fitter: str, other: str) -> Interval:
        """RMS distance between the corners of two fitters in the same scans, over the RMS error by the other."""
        one, two = (self.trials[name, "published"] for name in (fitter, other))
        between = one.errors - two.errors + (one.corners - two.corners)[:, None]
        both = np.isfinite(between[..., :1])
        return ratio(*((np.where(both, x, 0.0) ** 2).sum((0, 2)) for x in (between, two.errors))).root()


def _areas(covariances: Array) -> Array:
    """m², of the one-sigma ellipses."""
    xx, xy, yy = covariances[..., 0, 0], covariances[..., 0, 1], covariances[..., 1, 1]
    return np.pi * np.sqrt(xx * yy - xy * xy)


def simulated(
    place: Place, segmentation: Segmentation, settings: ExtractionSettings, scans: int, seed: Sequence[int]
) -> CornerStudy:
    """Scans of a place with the noise of the settings; equal arguments give equal numbers."""
    rng = np.random.default_rng(seed)
    trials = simulate([place], segmentation, settings, scans, rng)
    return CornerStudy(
        {(name, kind): trials[name, kind][::-1] for name in FITTERS for kind in KINDS},  # clockwise
        place.bounds[::-1],
    )


def recorded(scans: Sequence[Scan], settings: ExtractionSettings, fitters: Sequence[str]) -> CornerStudy:
    """Scans of a sensor at rest. A corner counts if at least half of them show it to every fitter.

    Raises EvaluationError if there are too few scans, or no corner that stays in its place.
    """
    if len(scans) < LEAST_SCANS:
        raise EvaluationError(
            f"{len(scans)} scans are too few: give at least {LEAST_SCANS} of a sensor at rest."
        )
    corners = [{name: f.corners for name, f in compare(scan, settings, fitters).items()} for scan in scans]
    first = corners[0][fitters[0]].xy[::-1]  # clockwise
    places = {name: np.full((len(first), len(scans), 2), np.nan) for name in fitters}
    claims: dict[Method, Array] = {
        (name, kind): np.full((len(first), len(scans), 2, 2), np.nan) for name in fitters for kind in KINDS
    }
    for k, of_scan in enumerate(corners):
        for name, found in of_scan.items():
            p, q = _matched(first, found)
            places[name][p, k] = found.xy[q]
            claims[name, "published"][p, k] = found.covariance_published[q]
            claims[name, "consistent"][p, k] = found.covariance_consistent[q]
    found_by_all = np.all([np.isfinite(xy[..., 0]) for xy in places.values()], axis=0)
    seen = 2 * found_by_all.sum(1) >= len(scans)
    if not seen.any():
        raise EvaluationError(
            "No corner stays where it is: the sensor must stand still in a room with straight walls."
        )
    means = {name: np.nanmean(xy[seen], axis=1) for name, xy in places.items()}
    none = np.full((int(seen.sum()), 2, 2), np.nan)
    trials: dict[Method, Trials] = {}
    for (name, kind), of in claims.items():
        trials[name, kind] = Trials(places[name][seen] - means[name][:, None], of[seen], none, means[name])
    return CornerStudy(trials, None)


def _matched(first: Array, found: Corners) -> tuple[Ints, Ints]:
    """Corners of the first scan with the nearest of another, if that is near enough; indices of both."""
    if not len(found) or not len(first):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    distance = np.linalg.norm(first[:, None] - found.xy, axis=-1)
    nearest = distance.argmin(1)
    near: Ints = np.flatnonzero(distance[np.arange(len(first)), nearest] < SAME)
    return near, nearest[near]
