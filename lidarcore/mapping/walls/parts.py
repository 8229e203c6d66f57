"""Walls before anything meets: a line, from where to where, and the segments that it was seen by."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.walls.extents import stretches
from lidarcore.mapping.walls.fitting import Fit, fit_line
from lidarcore.mapping.walls.grouping import Group
from lidarcore.mapping.walls.pieces import Pieces
from lidarcore.mapping.walls.settings import WallSettings

_ALIKE = 0.9  # cosine of the angle between surfaces that face one way
_HALF = 0.5  # share of a segment that lies on a part for it to speak for it
_HOLE = 0.05  # m along a wall that must be out of sight for something to stand there
_FOOT = 0.1  # m beside such a hole within which what stands there has its foot
# Times the distance of settings, within which two surfaces that face one way cannot both be there.
_BEHIND = 2.5


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A wall: segments (N,) by their number, the line through them, and where it begins and ends along it (m)."""

    members: Ints
    fit: Fit
    low: float
    high: float

    @property
    def ends(self) -> Array:
        """(2, 2) m, world frame."""
        return np.stack([self.fit.point(self.low), self.fit.point(self.high)])

    @property
    def length(self) -> float:
        """Length in m."""
        return self.high - self.low


def find_parts(
    pieces: Pieces, groups: Sequence[Group], grid: OccupancyGrid, settings: WallSettings
) -> list[Part]:
    """The parts of all groups that still stand, the ones seen most first."""
    parts = [part for group in groups for part in _parts_of(pieces, group, grid, settings)]
    parts.sort(key=lambda part: -len(part.members) * part.length)
    return _interrupted(pieces, _without_shadows(parts, settings), settings)


def _parts_of(pieces: Pieces, group: Group, grid: OccupancyGrid, settings: WallSettings) -> Iterator[Part]:
    """The stretches of a group, each with a line of its own, and what of them stands along that."""
    found = stretches(pieces, group.members, group.fit, grid, settings)
    for low, high in found:
        if high - low < settings.min_length:
            continue
        own = members_on(pieces, group, low, high) if len(found) > 1 else group.members
        if len(np.unique(pieces.keyframe[own])) < settings.min_count:
            continue
        fit = fit_line(pieces, own) if len(found) > 1 else group.fit
        first, last = fit.coordinates(np.stack([group.fit.point(low), group.fit.point(high)]))[0]
        for a, b in stretches(pieces, own, fit, grid, settings).clip(first, last).tolist():
            if b - a >= settings.min_length:
                yield Part(own, fit, a, b)


def members_on(pieces: Pieces, group: Group | Part, low: float, high: float) -> Ints:
    """Members of a group whose segments lie mostly between two coordinates, or cover most of what is there."""
    t, _ = group.fit.coordinates(pieces.ends[group.members])
    first, last = t.min(axis=1), t.max(axis=1)
    shared = np.minimum(last, high) - np.maximum(first, low)
    own = group.members[shared >= _HALF * np.minimum(last - first, high - low)]
    return own if len(own) else group.members


def _interrupted(pieces: Pieces, parts: Sequence[Part], settings: WallSettings) -> list[Part]:
    """All parts, in pieces where walls that stand on their lines hide them where they stand."""
    ends = np.array([part.ends for part in parts]).reshape(-1, 2, 2)
    normals = np.array([part.fit.normal for part in parts]).reshape(-1, 2)
    found = list[Part]()
    for part in parts:
        t, beside = part.fit.coordinates(ends)
        turned = np.abs(normals @ part.fit.along) >= np.sin(settings.corner_angle)
        feet = t[(np.abs(beside) <= settings.corner_gap) & turned[:, None]]
        cuts = [cut for cut in _holes(pieces, part).tolist() if _stands_in(feet, *cut)]
        found += _pieces_of(pieces, part, cuts, settings) if cuts else [part]
    return found


def _stands_in(feet: Array, low: float, high: float) -> bool:
    return bool(((feet > low - _FOOT) & (feet < high + _FOOT)).any())


def _pieces_of(
    pieces: Pieces, part: Part, cuts: Sequence[Sequence[float]], settings: WallSettings
) -> Iterator[Part]:
    """What is left of a part beside its cuts, each with a line of its own."""
    bounds = [part.low, *(bound for cut in cuts for bound in cut), part.high]
    for low, high in zip(bounds[::2], bounds[1::2], strict=True):
        if high - low >= settings.min_length:
            own = members_on(pieces, part, low, high)
            fit = fit_line(pieces, own)
            first, last = fit.coordinates(np.stack([part.fit.point(low), part.fit.point(high)]))[0].tolist()
            yield Part(own, fit, first, last)


def _holes(pieces: Pieces, part: Part) -> Array:
    """Stretches (N, 2) within a part that none of its segments covers."""
    t, _ = part.fit.coordinates(pieces.ends[part.members])
    order = np.argsort(t.min(axis=1), kind="stable")
    first, reach = t.min(axis=1)[order][1:], np.maximum.accumulate(t.max(axis=1)[order])[:-1]
    open_ = (first - reach > _HOLE) & (reach > part.low) & (first < part.high)
    return np.stack([reach[open_], first[open_]], -1)


def _without_shadows(parts: Sequence[Part], settings: WallSettings) -> list[Part]:
    """What is left of parts, best first, without what lies right before or behind a better one.

    From one side only one of two surfaces can be seen: the other comes from keyframes that are placed badly, or it
    was there at another time.
    """
    kept: list[Part] = []
    ends, alphas = np.array([part.ends for part in parts]), np.array([part.fit.alpha for part in parts])
    for i, part in enumerate(parts):
        spans = np.array([[part.low, part.high]])
        facing = ends[:i][np.cos(alphas[:i] - part.fit.alpha) > _ALIKE]  # of better ones
        for cut in _shadows(part, facing, _BEHIND * settings.distance):
            spans = _minus(spans, *cut)
        kept += [replace(part, low=a, high=b) for a, b in spans.tolist() if b - a >= settings.min_length]
    return kept


def _shadows(part: Part, ends: Array, depth: float) -> Array:
    """Stretches (N, 2) along a part that lie within a depth of one of the walls with ends (M, 2, 2)."""
    t, beside = part.fit.coordinates(ends)
    low, width = t[:, :1], t[:, 1:] - t[:, :1]
    share = np.clip([part.low, part.high] - low, 0, width) / width
    near = np.abs(beside[:, :1] + share * (beside[:, 1:] - beside[:, :1])) < depth
    return t[near.all(axis=1) & (t[:, 1] > part.low) & (t[:, 0] < part.high)]


def _minus(spans: Array, low: float, high: float) -> Array:
    """Stretches (N, 2) without what lies between two coordinates."""
    before = np.stack([spans[:, 0], np.minimum(spans[:, 1], low)], -1)
    after = np.stack([np.maximum(spans[:, 0], high), spans[:, 1]], -1)
    both = np.vstack([before, after])
    return both[both[:, 1] > both[:, 0]]
