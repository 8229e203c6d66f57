"""Repeatability: a sensor that stands still sees the same corners again and again; does each method know how well?

[WCTLS, Fig. 4] compares ellipse areas over 100 scans; here the ellipses are held against the scatter, too. What is the
same in every scan, such as a bias, cannot be seen this way.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from lidarcore.errors import EvaluationError
from lidarcore.evaluation.consistency_design import KINDS
from lidarcore.evaluation.repeatability_summary import WHISKER, Box, Claim, Method, Summary, verdict
from lidarcore.evaluation.scatter import (
    LEAST,
    SIGHTING,
    Scatter,
    Sightings,
    one_sigma_areas,
    scatter,
)
from lidarcore.evaluation.standstill import moves
from lidarcore.features import Features
from lidarcore.lines import FITTERS
from lidarcore.scan import Array, Ints
from lidarcore.tracking import Tracker

WINDOW = 100
_FOLLOW = 0.1  # of the way to a new sighting that the known place of a corner goes


@dataclass(frozen=True, slots=True, eq=False)
class _Record:
    """One scan: ids (K,); table (K, M, SIGHTING), NaN where not found; areas (M, 2) m², medians over the corners."""

    ids: Ints
    table: Array
    areas: Array


class Repeatability:
    """The last `window` scans of a sensor that stands still, by several methods; it begins anew when the sensor moves.

    Raises EvaluationError for a window too small to judge a corner in, or a method that does not exist.
    """

    def __init__(self, window: int = WINDOW, methods: Iterable[str] = tuple(FITTERS)) -> None:
        self.window, self.methods = window, tuple(dict.fromkeys(methods))
        if window < LEAST:
            raise EvaluationError(f"A window of {window} scans is too short: give at least {LEAST}.")
        if unknown := [name for name in self.methods if name not in FITTERS]:
            raise EvaluationError(f"Unknown methods {unknown}: choose from {', '.join(FITTERS)}.")
        if not self.methods:
            raise EvaluationError(f"No method is given: choose from {', '.join(FITTERS)}.")
        self._tracker = Tracker(memory=window, follow=_FOLLOW)
        self.clear()

    def __len__(self) -> int:
        """Scans in the window."""
        return len(self._records)

    def clear(self) -> None:
        """Forget every scan: the sensor was moved, or something was set differently. Ids are never used again."""
        self._records = deque[_Record](maxlen=self.window)
        self._tracker.forget()
        self._moved = False

    def add(self, features: Mapping[str, Features]) -> None:
        """One more scan, as `compare(scan, settings, methods)` gives it.

        Raises EvaluationError if a method is missing in it.
        """
        if missing := [name for name in self.methods if name not in features]:
            raise EvaluationError(
                f"The features are without {', '.join(missing)}: compare() with every method."
            )
        self._records.append(self._record({name: features[name] for name in self.methods}))
        corners = self._sightings()
        if moves(corners, _places(corners.table), len(self._records) - 1):
            self.clear()
            self._moved = True
        elif len(self._records) == self.window:
            self._moved = False

    @property
    def moved(self) -> bool:
        """Whether the sensor moved and the window, which then began anew, is not full again."""
        return self._moved

    def summary(self) -> Summary:
        """What the window says now."""
        found = scatter(self._sightings(), len(self._records))
        areas = np.array([record.areas for record in self._records]).reshape(
            -1, len(self.methods), len(KINDS)
        )
        methods = tuple(_method(name, m, found, areas[:, m]) for m, name in enumerate(self.methods))
        return Summary(self.window, len(self._records), self._message(found), methods)

    def deviations(self, corner: int) -> dict[str, Array]:
        """(N, 2) m by method: where it saw the corner of that id, from the mean over the window, the oldest first.

        Raises EvaluationError for a corner that was not seen in the window.
        """
        corners = self._sightings()
        seen = corners.table[corners.ids == corner, :, :2]
        if not len(seen):
            known = np.unique(corners.ids).tolist()
            raise EvaluationError(f"There is no corner {corner} in the window; it has {known}.")
        return {name: _centred(seen[:, m]) for m, name in enumerate(self.methods)}

    def _record(self, features: Mapping[str, Features]) -> _Record:
        rows = self._tracker.rows(features)
        table = np.full((len(rows), len(self.methods), SIGHTING), np.nan)
        for m, (name, found) in enumerate(features.items()):
            at = [k for k, row in enumerate(rows) if name in row.index]
            which = [rows[k].index[name] for k in at]
            corners = found.corners
            table[at, m, :2] = corners.xy[which]
            table[at, m, 2:6] = corners.covariance_published[which].reshape(-1, 4)
            table[at, m, 6:] = corners.covariance_consistent[which].reshape(-1, 4)
        return _Record(np.array([row.id for row in rows], np.int64), table, _medians(one_sigma_areas(table)))

    def _sightings(self) -> Sightings:
        records = self._records
        if not records:
            nothing = np.empty(0, np.int64)
            return Sightings(nothing, nothing, np.empty((0, len(self.methods), SIGHTING)))
        ids = np.concatenate([record.ids for record in records])
        scans = np.repeat(np.arange(len(records)), [len(record.ids) for record in records])
        order = np.argsort(ids, kind="stable")
        return Sightings(ids[order], scans[order], np.concatenate([r.table for r in records])[order])

    def _message(self, found: Scatter) -> str | None:
        scans = len(self._records)
        if self._moved:
            ago = f"{scans} scan{'s' * (scans > 1)} ago" if scans else "just now"
            return f"The sensor moved {ago}: the window began anew."
        if scans < LEAST:
            return f"{scans} scans so far: a corner is judged from {LEAST} on."
        if not (found.counts >= LEAST).any():
            return f"No corner was seen in {LEAST} of the last {scans} scans."
        return None


def _places(table: Array) -> Array:
    """(R, 2) m, of each corner by the first method that has it."""
    first = np.isfinite(table[..., 0]).argmax(1)
    places: Array = table[np.arange(len(table)), first, :2]
    return places


def _centred(xy: Array) -> Array:
    """From their mean, those that are not NaN."""
    found: Array = xy[np.isfinite(xy[:, 0])]
    return found - found.mean(0) if len(found) else found


def _medians(values: Array) -> Array:
    """Over the first axis, without NaN; NaN where there is nothing else."""
    ordered = np.sort(values, axis=0)  # NaN last
    n = np.isfinite(values).sum(0)
    padded = np.concatenate([ordered, np.full((1, *values.shape[1:]), np.nan)])
    low, high = (np.take_along_axis(padded, k[None], 0)[0] for k in (np.maximum(n - 1, 0) // 2, n // 2))
    medians: Array = (low + high) / 2
    return medians


def _method(name: str, m: int, found: Scatter, areas: Array) -> Method:
    corners = tuple(found.corners(m))
    actual = float(np.median([corner.area for corner in corners])) if corners else None
    judged = [found.judgement(m, k) for k in range(len(KINDS))]
    claims: dict[str, Claim] = {
        kind: Claim(_box(areas[:, k]), judged[k], verdict(judged[k])) for k, kind in enumerate(KINDS)
    }
    return Method(name, actual, claims, corners)


def _box(values: Array) -> Box | None:
    kept = np.sort(values[np.isfinite(values)])
    if not len(kept):
        return None
    first, median, third = np.quantile(kept, (0.25, 0.5, 0.75)).tolist()
    reach = WHISKER * (third - first)
    inside = (kept >= first - reach) & (kept <= third + reach)
    low, high = kept[inside][[0, -1]].tolist()
    return Box(low, first, median, third, high, tuple(kept[~inside].tolist()), len(kept))
