"""Corners: where the lines of two walls meet, close to an end of at least one and on the other."""

from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array, Ints
from lidarcore.mapping.walls.parts import Part
from lidarcore.mapping.walls.settings import WallSettings

_SHARE = 0.4  # of a wall's length that a corner may move its end by


@dataclass(frozen=True, slots=True, eq=False)
class Intersections:
    """C corners of walls: intersections of their lines.

    walls  (C, 2) which; the first one ends there
    side   (C,) 0 or 1: which end of the first one
    xy     (C, 2) m, world frame
    """

    walls: Ints
    side: Ints
    xy: Array


def find_intersections(parts: list[Part], settings: WallSettings) -> Intersections:
    """For every end of every wall the nearest corner, if there is one within the gap that settings allow."""
    if not parts:
        return Intersections(np.empty((0, 2), np.int64), np.empty(0, np.int64), np.empty((0, 2)))
    centre = np.stack([part.fit.centre for part in parts])
    normal = np.stack([part.fit.normal for part in parts])
    along = np.stack([part.fit.along for part in parts])
    spans = np.array([[part.low, part.high] for part in parts])
    found = []
    for i, part in enumerate(parts):
        sine = normal @ part.fit.along
        with np.errstate(divide="ignore", invalid="ignore"):
            t = ((centre - part.fit.centre) * normal).sum(axis=1) / sine
        xy = part.fit.centre + t[:, None] * part.fit.along
        on_other = ((xy - centre) * along).sum(axis=1)
        outside = np.maximum(spans[:, 0] - on_other, on_other - spans[:, 1])
        meets = (np.abs(sine) >= np.sin(settings.corner_angle)) & (outside <= settings.corner_gap)
        for side in (0, 1):
            gap = np.where(meets, np.abs(t - spans[i, side]), np.inf)
            j = int(np.argmin(gap))
            if gap[j] <= min(settings.corner_gap, _SHARE * part.length):
                found.append(((i, j), side, xy[j]))
    return Intersections(
        np.array([walls for walls, _, _ in found], np.int64).reshape(-1, 2),
        np.array([side for _, side, _ in found], np.int64),
        np.array([at for _, _, at in found], np.float64).reshape(-1, 2),
    )
