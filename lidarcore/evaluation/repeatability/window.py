"""Features of one kind in the last scans of a sensor that stands still: what was seen of them, and what that says."""

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Iterator, Sequence
from statistics import median
from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.consistency.design import KINDS
from lidarcore.evaluation.repeatability.observations import OBSERVATION, Observations, covariances, root_det
from lidarcore.evaluation.repeatability.scatter import LEAST, Scatter, scatter
from lidarcore.evaluation.repeatability.summary import WHISKER, Box, Claim, FeatureScatter, verdict
from lidarcore.evaluation.repeatability.wall_tracker import WallRow
from lidarcore.tracking import CornerRow


class _Record(NamedTuple):
    """One scan: table (K, M, OBSERVATION), NaN where not found; areas (M, 2), medians over the features."""

    table: Array
    areas: Array


class FeatureWindow:
    """Corners, or walls, in the last `window` scans, by several methods."""

    def __init__(self, window: int, methods: tuple[str, ...], noun: str) -> None:
        self.methods, self.noun = methods, noun
        self._records = deque[_Record](maxlen=window)
        self._added = 0
        self.clear()

    def __len__(self) -> int:
        """Scans in the window."""
        return len(self._records)

    def clear(self) -> None:
        """Forget every scan."""
        self._records.clear()
        self._firsts = Observations(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 2)))

    def add(self, rows: Sequence[CornerRow | WallRow], table: Array) -> None:
        """One more scan: its features, and what each method saw of them (K, M, OBSERVATION), NaN where nothing."""
        k, first = np.arange(len(table)), np.isfinite(table[..., 0]).argmax(1)
        ids = np.array([row.id for row in rows], np.int64)
        new = Observations(ids, np.full(len(ids), self._added), table[k, first, :2])
        oldest = len(self._records[0].table) if len(self) == self._records.maxlen else 0
        self._firsts = Observations.joined([self._firsts[oldest:], new])
        one_sigma_areas = np.pi * root_det(covariances(table))
        self._records.append(_Record(table, _medians(one_sigma_areas)))
        self._added += 1

    def observations(self) -> Observations:
        """All observations in the window, sorted by feature."""
        nothing = np.empty((0, len(self.methods), OBSERVATION))
        return self._sorted(np.concatenate([nothing, *(record.table for record in self._records)]))

    def firsts(self) -> Observations:
        """The two coordinates (R, 2) of each observation by the first method that has it, sorted by feature."""
        return self._sorted(self._firsts.table)

    def _sorted(self, table: Array) -> Observations:
        order = np.argsort(self._firsts.ids, kind="stable")
        scans = self._firsts.scans[order] - (self._added - len(self))
        return Observations(self._firsts.ids[order], scans, table[order])

    def scatter(self) -> Scatter:
        """The figures of the window."""
        return scatter(self.observations(), len(self))

    def claims(
        self, found: Scatter
    ) -> list[tuple[str, float | None, dict[str, Claim], tuple[FeatureScatter, ...]]]:
        """For each method its name, the median area of the scatter, its claims, and each feature judged."""
        areas = np.array([record.areas for record in self._records])
        boxes = _boxes(areas.reshape(len(self), len(self.methods) * len(KINDS)))
        return [
            (
                name,
                median(feature.area for feature in features) if features else None,
                {
                    kind: Claim(next(boxes), judged, verdict(judged))
                    for kind, judged in zip(KINDS, by_kind, strict=True)
                },
                features,
            )
            for name, by_kind, features in zip(
                self.methods, found.judgements(), found.features(), strict=True
            )
        ]

    def deviations(self, number: int) -> dict[str, Array]:
        """(N, 2) by method: where it saw the feature of that id, from the mean over the window, the oldest first.

        Raises EvaluationError for one that was not seen in the window.
        """
        observations = self.observations()
        seen = observations.table[observations.ids == number, :, :2]
        if not len(seen):
            known = np.unique(observations.ids).tolist()
            raise EvaluationError(f"There is no {self.noun} {number} in the window; it has {known}.")
        return {name: _centred(seen[:, m]) for m, name in enumerate(self.methods)}

    def trouble(self, found: Scatter) -> str | None:
        """Why nothing can be judged, in plain words; None if something can."""
        scans = len(self)
        if scans < LEAST:
            return f"{scans} scans so far: a {self.noun} is judged from {LEAST} on."
        if not found.is_judged:
            return f"No {self.noun} was seen in {LEAST} of the last {scans} scans."
        return None


def _centred(pairs: Array) -> Array:
    """The pairs that are not NaN, as deviations from their mean."""
    found: Array = pairs[np.isfinite(pairs[:, 0])]
    return found - found.mean(0) if len(found) else found


def _medians(values: Array) -> Array:
    """Medians over the first axis, without NaN; NaN where there is nothing else."""
    ordered = np.sort(values, axis=0)  # NaN last
    n = np.isfinite(values).sum(0)
    padded, rest = np.concatenate([ordered, np.full((1, *n.shape), np.nan)]), tuple(np.indices(n.shape))
    return (padded[np.maximum(n - 1, 0) // 2, *rest] + padded[n // 2, *rest]) / 2


def _boxes(values: Array) -> Iterator[Box | None]:
    """A box plot's figures of each column of (N, C) without NaN; None for one where there is nothing else."""
    ordered = np.sort(values, axis=0)  # NaN last
    counts = np.isfinite(values).sum(0)
    quartiles = np.full((3, len(counts)), np.nan)
    for n in np.unique(counts[counts > 0]):
        quartiles[:, counts == n] = np.quantile(ordered[:n, counts == n], (0.25, 0.5, 0.75), axis=0)
    for kept, n, box in zip(ordered.T.tolist(), counts.tolist(), quartiles.T.tolist(), strict=True):
        yield _box(kept[:n], *box) if n else None


def _box(kept: list[float], first: float, middle: float, third: float) -> Box:
    reach = WHISKER * (third - first)
    begin, end = bisect_left(kept, first - reach), bisect_right(kept, third + reach)
    outliers = (*kept[:begin], *kept[end:])
    return Box(kept[begin], first, middle, third, kept[end - 1], outliers, len(kept))
