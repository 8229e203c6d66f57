"""Corners matched across methods by their pair of segments, and followed from frame to frame."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from lidarcore.arrays import Array
from lidarcore.features import Features
from lidarcore.geometry import chi_square_gate, squared_mahalanobis

GATE = 0.3  # m: a corner found farther away than this is another one
MEMORY = 10  # frames a corner may be missing and still keep its id, if not told otherwise
SAME = 0.9999  # what lies in the ellipse that holds this share of the sightings of a place may be that place


@dataclass(frozen=True, slots=True)
class CornerRow:
    """One corner of the scan: its segments in the first method that found it, its index in each that did."""

    id: int
    segments: tuple[int, int]
    index: Mapping[str, int]


def match(features: Mapping[str, Features]) -> list[dict[str, int]]:
    """Corners of several methods on one segmentation: for each, {method: its index there}.

    The pair of segments is known by the beams that face each other, since indices of segments differ where
    one method rejected a piece that another one took.
    """
    rows: dict[tuple[int, int], dict[str, int]] = {}
    for name, found in features.items():
        first, second = found.corners.segments.T
        ends, starts = found.segments.last_beam[first], found.segments.first_beam[second]
        for i, pair in enumerate(zip(ends.tolist(), starts.tolist(), strict=True)):
            rows.setdefault(pair, {})[name] = i
    return list(rows.values())


@dataclass(slots=True)
class _Known:
    """A corner as it is remembered.

    place (2,) m, where it was last; home (2,) m and covariance (2, 2) m², of its first sighting since the sensor came
    to rest; frame, the number of the last one that showed it.
    """

    place: Array
    home: Array
    covariance: Array
    frame: int


@dataclass
class Tracker:
    """Gives every corner an id that it keeps while it stays within GATE of where it last was.

    memory   frames a corner may be missing and still keep its id
    follow   share of the way to a new sighting that its known place goes: all of it, or less where nothing moves, so
             that one gross error does not make two corners of one
    dormant  frames it may be missing while the sensor stands still and still get its id back, at the same place as
             far as covariances tell (SAME)
    """

    memory: int = MEMORY
    follow: float = 1.0
    dormant: int = 0
    _known: dict[int, _Known] = field(default_factory=dict)
    _frame: int = 0
    _next_id: int = 1

    def forget(self) -> None:
        """Forget all corners: those of another scene are new. Ids are never used again."""
        self._known.clear()

    def rows(self, features: Mapping[str, Features]) -> tuple[CornerRow, ...]:
        """The corners of one frame with their ids; positions are those of the first method that has them."""
        rows = match(features)
        firsts = [next(iter(row.items())) for row in rows]
        found = [(features[name].corners, i) for name, i in firsts]
        xy = np.array([corners.xy[i] for corners, i in found]).reshape(-1, 2)
        covariances = np.array([_scatter(features[name], i) for name, i in firsts]).reshape(-1, 2, 2)
        ids = self._identify(xy, covariances)
        pairs = [(int(corners.segments[i, 0]), int(corners.segments[i, 1])) for corners, i in found]
        return tuple(CornerRow(*row) for row in zip(ids, pairs, rows, strict=True))

    def _identify(self, xy: Array, covariances: Array) -> list[int]:
        self._frame += 1
        longest = max(self.memory, self.dormant)
        self._known = {i: known for i, known in self._known.items() if self._missing(known) <= longest}
        ids = self._again(xy, covariances)
        for row, (at, covariance) in enumerate(zip(xy, covariances, strict=True)):
            if ids[row] == 0:
                ids[row], self._next_id = self._next_id, self._next_id + 1
                self._known[ids[row]] = _Known(at, at, covariance, self._frame)
            known = self._known[ids[row]]
            known.place = known.place + self.follow * (at - known.place)
            known.frame = self._frame
        return ids

    def _missing(self, known: _Known) -> int:
        return self._frame - known.frame

    def _again(self, xy: Array, covariances: Array) -> list[int]:
        """The known id for each position, closest pairs first, each id once; 0 where it is a new one."""
        awake = [i for i, known in self._known.items() if self._missing(known) <= self.memory]
        places = np.array([self._known[i].place for i in awake]).reshape(-1, 2)
        steps = np.linalg.norm(xy[:, None] - places, axis=2)
        ids = _assigned([0] * len(xy), awake, steps, GATE)
        if not self.dormant:
            return ids
        if self._moved(ids, xy, covariances):
            self._settle(ids, xy, covariances)
            return ids
        known = list(self._known)
        at_home = _assigned(
            [0] * len(xy), known, self._distances(known, xy, covariances), chi_square_gate(SAME)
        )
        return _assigned(at_home, awake, steps, GATE)

    def _distances(self, ids: list[int], xy: Array, covariances: Array) -> Array:
        """(N, K) Mahalanobis distances² between positions and where the K known corners were when all stood still."""
        if not ids:
            return np.empty((len(xy), 0))
        homes = np.array([self._known[i].home for i in ids])
        known = np.array([self._known[i].covariance for i in ids])
        return squared_mahalanobis(xy[:, None] - homes, covariances[:, None] + known)

    def _moved(self, ids: list[int], xy: Array, covariances: Array) -> bool:
        """Whether most corners in view are no longer where they were: then the sensor moves."""
        rows = np.flatnonzero(ids)
        if not len(rows):
            return False
        seen = self._distances([ids[row] for row in rows], xy[rows], covariances[rows]).diagonal()
        return bool(np.median(seen) > chi_square_gate(SAME))

    def _settle(self, ids: list[int], xy: Array, covariances: Array) -> None:
        """Where hidden corners are is not known any more; the others begin anew from here."""
        self._known = {i: known for i, known in self._known.items() if self._missing(known) <= self.memory}
        for id_, at, covariance in zip(ids, xy, covariances, strict=True):
            if id_:
                known = self._known[id_]
                known.home, known.covariance = at, covariance


def _scatter(features: Features, corner: int) -> Array:
    """(2, 2) m², of a corner from scan to scan: what its method derives, and more if the scan is noisier than told."""
    return features.noise_excess**2 * features.corners.covariance_consistent[corner]


def _assigned(ids: list[int], known: list[int], distances: Array, most: float) -> list[int]:
    """Ids for positions that have none: of the K known by distances (N, K), the smallest first, none beyond `most`."""
    ids, near = ids.copy(), distances <= most
    for row, column in np.argwhere(near)[np.argsort(distances[near])].tolist():
        if ids[row] == 0 and known[column] not in ids:
            ids[row] = known[column]
    return ids
