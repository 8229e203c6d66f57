"""Walls followed from scan to scan while the sensor stands still."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array, Columns, Ints
from lidarcore.features import Features
from lidarcore.geometry import wrap

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


@dataclass(frozen=True, slots=True, eq=False)
class _Known(Columns):
    """K walls as they were seen so far, the oldest first.

    ids, frames (K,) of the last observation; near (K,) rad, alpha of the first; lines (K, 4) alpha, r, begin, end: from
    where to where along it (m).
    """

    ids: Ints
    frames: Ints
    near: Array
    lines: Array


_NOTHING = _Known(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0), np.empty((0, 4)))


class WallTracker:
    """Gives every wall an id that it keeps while a piece of about the same line and extent is found.

    How near is near enough depends on the noise seen in the scan, not on what a method claims: a face of a chair that
    is found instead of another one is another wall, a short wall that noise has tilted is the same.
    Of several pieces of a wall that fell apart the one that shares most of its extent keeps the id, so that a
    changed extent is part of what is judged. Methods share a segmentation: pieces are matched by their beams.

    memory   frames a wall may be missing and still keep its id
    follow   share of the way to a new observation that the known wall goes
    """

    def __init__(self, memory: int, follow: float = 1.0) -> None:
        self.memory, self.follow = memory, follow
        self._known, self._frame, self._next_id = _NOTHING, 0, 1

    def forget(self) -> None:
        """Forget all walls: those of another scene are new. Ids are never used again."""
        self._known = _NOTHING

    def rows(self, features: Mapping[str, Features]) -> tuple[WallRow, ...]:
        """The walls of one frame with their ids; extents are those of the first method that has them."""
        self._frame += 1
        self._known = self._known[self._frame - self._known.frames <= self.memory]
        pieces = _pieces(features)
        lines = _lines(features, pieces)
        noise = max((found.noise_seen for found in features.values()), default=0.0)
        at = self._nearest(lines, noise)
        self._follow(at[at >= 0], lines[at >= 0])
        at[at < 0] = self._begin(lines[at < 0])
        ids, near = self._known.ids[at].tolist(), self._known.near[at].tolist()
        return tuple(WallRow(*row) for row in zip(ids, near, pieces, strict=True))

    def _nearest(self, lines: Array, noise: float) -> Ints:
        """(P,) the known wall for each piece (P, 6), most shared extent first, each once; -1 where none is near."""
        at, taken = [-1] * len(lines), set[int]()
        shares = shared_extents(lines, self._known.lines, noise)
        for row, column in np.argwhere(shares > 0)[np.argsort(-shares[shares > 0])].tolist():
            if at[row] < 0 and column not in taken:
                at[row] = column
                taken.add(column)
        return np.array(at, np.int64)

    def _follow(self, at: Ints, lines: Array) -> None:
        """Move known walls towards their observations (P, 6)."""
        before = self._known.lines[at]
        alpha, r = unwrapped(lines, before[:, 0])
        seen = np.column_stack([alpha, r, _along(lines, before[:, 0])])
        self._known.lines[at] = before + self.follow * (seen - before)
        self._known.frames[at] = self._frame

    def _begin(self, lines: Array) -> Ints:
        """Know walls (P, 6) from now on; (P,) where they are kept."""
        k, n = len(self._known), len(lines)
        ids, self._next_id = self._next_id + np.arange(n), self._next_id + n
        alpha = lines[:, 0]
        seen = np.column_stack([lines[:, :2], _along(lines, alpha)])
        new = _Known(ids, np.full(n, self._frame), alpha, seen)
        self._known = _Known.joined([self._known, new])
        return k + np.arange(n)


def unwrapped(lines: Array, near: Array) -> tuple[Array, Array]:
    """Alpha (rad) and r (m) of lines (..., 2) with the alpha next to `near`; r < 0 where it is turned for that."""
    alpha, r = lines[..., 0], lines[..., 1]
    off = wrap(alpha - near)
    turned = np.abs(off) > np.pi / 2
    return near + off - np.where(turned, np.copysign(np.pi, off), 0.0), np.where(turned, -r, r)


def told_near(observations: Array, near: Array) -> Array:
    """Observations (..., 2 + 4 n) of lines, alpha, r and n covariances of them, with the alpha next to `near` (rad)."""
    told = observations.copy()
    told[..., 0], told[..., 1] = unwrapped(observations, near)
    signs = np.where(told[..., 1:2] < 0, -1.0, 1.0)
    for covariance_of_both in (3, 4):
        told[..., covariance_of_both::4] *= signs
    return told


def _pieces(features: Mapping[str, Features]) -> list[dict[str, int]]:
    """The pieces of the scan, each as {method: its index there}."""
    pieces: dict[tuple[int, int], dict[str, int]] = {}
    for name, found in features.items():
        segments = found.segments
        ends = zip(segments.first_beam.tolist(), segments.last_beam.tolist(), strict=True)
        for i, beams in enumerate(ends):
            pieces.setdefault(beams, {})[name] = i
    return list(pieces.values())


def _lines(features: Mapping[str, Features], pieces: list[dict[str, int]]) -> Array:
    """(P, 6) alpha, r, start x, y, end x, y of each piece by the first method that has it."""
    owners = [next(iter(piece.items())) for piece in pieces]
    tables = {}
    for name in {name for name, _ in owners}:
        lines, segments = features[name].lines, features[name].segments
        tables[name] = np.column_stack([lines.alpha, lines.r, segments.start, segments.end])
    return np.array([tables[name][i] for name, i in owners]).reshape(-1, 6)


def _along(lines: Array, alpha: Array) -> Array:
    """(P, 2) from where to where (m) along walls with the normals alpha (P,) pieces (P, 6) go."""
    tangents = np.column_stack([-np.sin(alpha), np.cos(alpha)])
    return np.sort((lines[:, 2:].reshape(-1, 2, 2) @ tangents[..., None])[..., 0], axis=1)


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
