"""Walls followed from scan to scan while the sensor stands still."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from lidarcore.arrays import Array
from lidarcore.features import Features

SHARED = 0.5  # of the shorter one, at least, lies side by side with the other
_TILT = 0.1  # rad between a wall and what may be it again, if there were no noise
_MOST_TILT = 0.35  # rad; corners begin here
_OFFSET = 0.1  # m between the two where they lie side by side, if there were no noise
_SIGMAS = 2.0  # that noise may add to either, of the worst wall: six points, evenly spaced


@dataclass(frozen=True, slots=True)
class WallRow:
    """One wall of the scan: its index in each method that has it, and the alpha (rad) it is told near to."""

    id: int
    near: float
    index: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class _Known:
    """A wall as it was seen so far: its line, from where to where along it (m), first alpha, last frame."""

    alpha: float
    r: float
    begin: float
    end: float
    near: float
    frame: int


@dataclass
class WallTracker:
    """Gives every wall an id that it keeps while a piece of about the same line and extent is found.

    How near is near enough depends on the noise seen in the scan, not on what a method claims: a face of a chair that
    is found instead of another one is another wall, a short wall that noise has tilted is the same.
    Of several pieces of a wall that fell apart the one that shares most of its extent keeps the id, so that a
    changed extent is part of what is judged. Methods share a segmentation: pieces are matched by their beams.

    memory   frames a wall may be missing and still keep its id
    follow   share of the way to a new sighting that the known wall goes
    """

    memory: int
    follow: float = 1.0
    _known: dict[int, _Known] = field(default_factory=dict)
    _frame: int = 0
    _next_id: int = 1

    def forget(self) -> None:
        """Another scene: no wall of it is one seen before. Ids are never used again."""
        self._known.clear()

    def rows(self, features: Mapping[str, Features]) -> tuple[WallRow, ...]:
        """The walls of one frame with their ids; extents are those of the first method that has them."""
        self._frame += 1
        self._known = {i: k for i, k in self._known.items() if self._frame - k.frame <= self.memory}
        pieces = _pieces(features)
        lines = _lines(features, pieces)
        noise = max((found.noise_seen for found in features.values()), default=0.0)
        return tuple(
            WallRow(number, self._update(number, line), piece)
            for number, line, piece in zip(self._nearest(lines, noise), lines, pieces, strict=True)
        )

    def _update(self, number: int, line: Array) -> float:
        """Move what is known towards a sighting; the alpha that the wall was first seen with."""
        alpha, r = line[:2].tolist()
        known = self._known.get(number)
        if known is None:
            begin, end = _along(line, alpha)
            self._known[number] = _Known(alpha, r, begin, end, alpha, self._frame)
            return float(alpha)
        turned, r = unwrapped(alpha, r, known.alpha)
        begin, end = _along(line, known.alpha)
        before = np.array([known.alpha, known.r, known.begin, known.end])
        moved = self.follow * (np.array([turned, r, begin, end]) - before)
        alpha, r, begin, end = (before + moved).tolist()
        self._known[number] = _Known(alpha, r, begin, end, known.near, self._frame)
        return known.near

    def _nearest(self, lines: Array, noise: float) -> list[int]:
        """The known id for each piece, most shared extent first, each id once; new ids where none is near."""
        ids = [0] * len(lines)
        known = list(self._known)
        table = [(k.alpha, k.r, k.begin, k.end) for k in self._known.values()]
        shares = shared_extents(lines, np.array(table).reshape(-1, 4), noise)
        for row, column in np.argwhere(shares > 0)[np.argsort(-shares[shares > 0])].tolist():
            if ids[row] == 0 and known[column] not in ids:
                ids[row] = known[column]
        for row in range(len(ids)):
            if ids[row] == 0:
                ids[row], self._next_id = self._next_id, self._next_id + 1
        return ids


def unwrapped(alpha: float, r: float, near: float) -> tuple[float, float]:
    """The same line (alpha rad, r m) with the alpha next to `near`; r < 0 where the normal is turned round for it."""
    off = float((alpha - near + np.pi) % (2 * np.pi) - np.pi)
    if abs(off) <= np.pi / 2:
        return near + off, r
    return near + off - float(np.copysign(np.pi, off)), -r


def _pieces(features: Mapping[str, Features]) -> list[dict[str, int]]:
    """For each piece {method: its index there}."""
    pieces: dict[tuple[int, int], dict[str, int]] = {}
    for name, found in features.items():
        segments = found.segments
        ends = zip(segments.first_beam.tolist(), segments.last_beam.tolist(), strict=True)
        for i, beams in enumerate(ends):
            pieces.setdefault(beams, {})[name] = i
    return list(pieces.values())


def _lines(features: Mapping[str, Features], pieces: list[dict[str, int]]) -> Array:
    """(P, 6) alpha, r, start x, y, end x, y of each piece by the first method that has it."""
    tables = {
        name: np.column_stack([found.lines.alpha, found.lines.r, found.segments.start, found.segments.end])
        for name, found in features.items()
    }
    owners = (next(iter(piece.items())) for piece in pieces)
    return np.array([tables[name][i] for name, i in owners]).reshape(-1, 6)


def _along(line: Array, alpha: float) -> list[float]:
    """From where to where (m) along a wall with the normal alpha a piece (6,) goes."""
    along: list[float] = np.sort(line[2:].reshape(2, 2) @ [-np.sin(alpha), np.cos(alpha)]).tolist()
    return along


def shared_extents(lines: Array, known: Array, noise: float) -> Array:
    """(P, K) intersection over union of the extents of pieces (P, 6) and known walls; 0 where they surely differ.

    known (K, 4): alpha, r, begin, end; noise (m) as it was seen in the scan.
    """
    alpha, r, begin, end = known.T
    c, s = np.cos(alpha), np.sin(alpha)
    x, y = lines[:, 2::2, None], lines[:, 3::2, None]  # (P, 2, 1)
    along, across = y * c - x * s, x * c + y * s - r  # (P, 2, K) of start and end
    first, last = along.min(1), along.max(1)
    low, high = np.maximum(first, begin), np.minimum(last, end)
    shorter = np.minimum(last - first, end - begin)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (across[:, 1] - across[:, 0]) / (along[:, 1] - along[:, 0])
        offset = np.abs(across[:, 0] + slope * ((low + high) / 2 - along[:, 0]))
        spread = _SIGMAS * noise * np.sqrt(2.0)  # of two ends, or, over the length, of a tilt
        near = (np.abs(np.arctan(slope)) <= np.minimum(_TILT + spread / shorter, _MOST_TILT)) & (
            offset <= _OFFSET + spread
        )
        share = (high - low) / (np.maximum(last, end) - np.minimum(first, begin))
    return np.where(near & (high - low > SHARED * shorter), share, 0.0)
