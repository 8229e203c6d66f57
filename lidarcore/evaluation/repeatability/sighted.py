"""Features of one kind in the last scans of a sensor that stands still: what was seen of them, and what that says."""

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.consistency.design import KINDS
from lidarcore.evaluation.repeatability.scatter import (
    LEAST,
    SIGHTING,
    Observations,
    Scatter,
    one_sigma_areas,
    scatter,
)
from lidarcore.evaluation.repeatability.summary import WHISKER, Box, Claim, FeatureScatter, verdict

Row = tuple[int, Mapping[str, int]]
"""Id of a feature, and its index in each method that found it."""


@dataclass(frozen=True, slots=True, eq=False)
class _Record:
    """One scan: ids (K,); table (K, M, SIGHTING), NaN where not found; areas (M, 2), medians over the features."""

    ids: Ints
    table: Array
    areas: Array


class Sighted:
    """Corners, or walls, in the last `window` scans, by several methods."""

    def __init__(self, window: int, methods: tuple[str, ...], noun: str) -> None:
        self.methods, self.noun = methods, noun
        self._records = deque[_Record](maxlen=window)

    def __len__(self) -> int:
        """Scans in the window."""
        return len(self._records)

    def clear(self) -> None:
        """Forget every scan."""
        self._records.clear()

    def add(self, rows: Iterable[Row], seen: Mapping[str, Array]) -> None:
        """One more scan: the rows of its features, and what each method saw (N, SIGHTING), NaN where nothing."""
        listed = list(rows)
        table = np.full((len(listed), len(self.methods), SIGHTING), np.nan)
        for m, name in enumerate(self.methods):
            at = [k for k, (_, index) in enumerate(listed) if name in index]
            table[at, m] = seen[name][[listed[k][1][name] for k in at]]
        ids = np.array([number for number, _ in listed], np.int64)
        self._records.append(_Record(ids, table, _medians(one_sigma_areas(table))))

    def sightings(self) -> Observations:
        """All of the window, sorted by feature."""
        records = self._records
        if not records:
            nothing = np.empty(0, np.int64)
            return Observations(nothing, nothing, np.empty((0, len(self.methods), SIGHTING)))
        ids = np.concatenate([record.ids for record in records])
        scans = np.repeat(np.arange(len(records)), [len(record.ids) for record in records])
        order = np.argsort(ids, kind="stable")
        return Observations(ids[order], scans[order], np.concatenate([r.table for r in records])[order])

    def scatter(self) -> Scatter:
        """The figures of the window."""
        return scatter(self.sightings(), len(self))

    def claims(
        self, found: Scatter
    ) -> list[tuple[str, float | None, dict[str, Claim], tuple[FeatureScatter, ...]]]:
        """For each method its name, the median area of the scatter, its claims, and each feature judged."""
        areas = np.array([record.areas for record in self._records]).reshape(
            -1, len(self.methods), len(KINDS)
        )
        return [(name, *_claims(m, found, areas[:, m])) for m, name in enumerate(self.methods)]

    def deviations(self, number: int) -> dict[str, Array]:
        """(N, 2) by method: where it saw the feature of that id, from the mean over the window, the oldest first.

        Raises EvaluationError for one that was not seen in the window.
        """
        sightings = self.sightings()
        seen = sightings.table[sightings.ids == number, :, :2]
        if not len(seen):
            known = np.unique(sightings.ids).tolist()
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
    """From their mean, those that are not NaN."""
    found: Array = pairs[np.isfinite(pairs[:, 0])]
    return found - found.mean(0) if len(found) else found


def _medians(values: Array) -> Array:
    """Over the first axis, without NaN; NaN where there is nothing else."""
    ordered = np.sort(values, axis=0)  # NaN last
    n = np.isfinite(values).sum(0)
    padded = np.concatenate([ordered, np.full((1, *values.shape[1:]), np.nan)])
    low, high = (np.take_along_axis(padded, k[None], 0)[0] for k in (np.maximum(n - 1, 0) // 2, n // 2))
    medians: Array = (low + high) / 2
    return medians


def _claims(
    m: int, found: Scatter, areas: Array
) -> tuple[float | None, dict[str, Claim], tuple[FeatureScatter, ...]]:
    features = tuple(found.features(m))
    actual = float(np.median([feature.area for feature in features])) if features else None
    judged = [found.judgement(m, k) for k in range(len(KINDS))]
    claims: dict[str, Claim] = {
        kind: Claim(_box(areas[:, k]), judged[k], verdict(judged[k])) for k, kind in enumerate(KINDS)
    }
    return actual, claims, features


def _box(values: Array) -> Box | None:
    kept = np.sort(values[np.isfinite(values)])
    if not len(kept):
        return None
    first, median, third = np.quantile(kept, (0.25, 0.5, 0.75)).tolist()
    reach = WHISKER * (third - first)
    inside = (kept >= first - reach) & (kept <= third + reach)
    low, high = kept[inside][[0, -1]].tolist()
    return Box(low, first, median, third, high, tuple(kept[~inside].tolist()), len(kept))
