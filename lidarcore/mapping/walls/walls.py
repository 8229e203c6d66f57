"""The walls of a map, with covariances: the algorithm on one screen."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_array, vstack

from lidarcore.arrays import Array, Ints
from lidarcore.geometry import wrap
from lidarcore.mapping.grid.occupancy import OccupancyGrid
from lidarcore.mapping.walls.ends import find_end
from lidarcore.mapping.walls.grouping import group_pieces
from lidarcore.mapping.walls.intersections import Intersections, find_intersections
from lidarcore.mapping.walls.joint import Corners, JointWalls
from lidarcore.mapping.walls.model import WallModel, corner_rows, wall_model
from lidarcore.mapping.walls.observations import Observations
from lidarcore.mapping.walls.parts import Part, find_parts
from lidarcore.mapping.walls.pieces import collect_pieces
from lidarcore.mapping.walls.settings import WallSettings
from lidarcore.mapping.walls.spread import Spread, common_spread
from lidarcore.scan import Scan
from lidarcore.settings import ExtractionSettings


@dataclass(frozen=True, slots=True, eq=False)
class WallCorners(Corners):
    """C corners where walls meet; `rows` (2 C, 4 W) are of what was estimated of walls, for `WallModel.covariance`.

    covariance  (C, 2, 2) m²
    walls       (C, 2) which two, by their place among the walls
    """

    covariance: Array
    walls: Ints


@dataclass(frozen=True, slots=True, eq=False)
class Walls(JointWalls):
    """The walls of a map as they were found, and what they have in common.

    end_covariance  (W, 4, 4) of both ends, x and y; along the wall it means nothing where `ended` is false
    observations    what of which segments each wall was seen by
    """

    corners: WallCorners
    model: WallModel = field(repr=False)
    end_covariance: Array
    observations: Observations = field(repr=False)

    def __repr__(self) -> str:
        return f"Walls({len(self)} walls, {self.length.sum():.1f} m, {len(self.corners)} corners)"


def find_walls(
    scans: Sequence[Scan],
    poses: Array,
    spread: Spread | Array,
    grid: OccupancyGrid,
    settings: WallSettings | None = None,
    extraction: ExtractionSettings | None = None,
    numbers: Ints | None = None,
) -> Walls:
    """The walls that scans saw and the grid still has, with ids from 0 on.

    scans at poses (K, 3), T_world_sensor; spread says how the poses err together, or is their covariances (K, 3, 3).
    numbers (K,) of the scans, rising, are those by which `WallIds` knows them again; by default from 0 on.
    """
    settings, extraction = settings or WallSettings(), extraction or ExtractionSettings()
    poses = np.asarray(poses, np.float64).reshape(-1, 3)
    numbers = np.arange(len(scans)) if numbers is None else numbers
    pieces = collect_pieces(scans, poses, extraction)
    parts = find_parts(pieces, group_pieces(pieces, settings), grid, settings)
    ends = [(find_end(pieces, part, 0), find_end(pieces, part, 1)) for part in parts]
    intersections = find_intersections(parts, settings)
    spread = spread if callable(spread) else common_spread(spread)
    model = wall_model(pieces, parts, ends, intersections, spread, len(scans), extraction.noise.systematic)
    xy = np.array([[part.fit.point(end.t) for end in pair] for part, pair in zip(parts, ends, strict=True)])
    xy = xy.reshape(-1, 2, 2)
    xy[intersections.walls[:, 0], intersections.side] = intersections.xy
    ended = np.array([[end.seen for end in pair] for pair in ends], bool).reshape(-1, 2)
    in_corner = np.zeros_like(ended)
    in_corner[intersections.walls[:, 0], intersections.side] = True
    stamps = np.array([scan.stamp for scan in scans])
    seen = [np.unique(pieces.keyframe[part.members]) for part in parts]
    covariances = model.of_walls()
    length, variance = _lengths(xy, covariances[:, 2:, 2:])
    alpha, r = _hesse(parts)
    return Walls(
        np.arange(len(parts)),
        alpha,
        r,
        covariances[:, :2, :2],
        xy,
        ended | in_corner,
        in_corner,
        length,
        variance,
        np.array([stamps[k].min() for k in seen]),
        np.array([stamps[k].max() for k in seen]),
        np.array([len(k) for k in seen], np.int64),
        _corners(parts, intersections, model),
        model,
        covariances[:, 2:, 2:],
        Observations.of(pieces, parts, numbers),
    )


def _hesse(parts: list[Part]) -> tuple[Array, Array]:
    alpha = np.array([part.fit.alpha for part in parts])
    r = np.array([part.fit.normal @ part.fit.centre for part in parts])
    return wrap(np.where(r < 0, alpha + np.pi, alpha)), np.abs(r)


def _lengths(ends: Array, covariance: Array) -> tuple[Array, Array]:
    difference = ends[:, 1] - ends[:, 0]
    length = np.hypot(difference[:, 0], difference[:, 1])
    along = difference / np.maximum(length, 1e-12)[:, None]
    J = np.concatenate([-along, along], axis=1)
    return length, (J[:, None] @ covariance @ J[:, :, None])[:, 0, 0]


def _corners(parts: list[Part], intersections: Intersections, model: WallModel) -> WallCorners:
    """Every pair of walls once, however many of their ends meet there."""
    pairs = np.sort(intersections.walls, axis=1)
    _, first = np.unique(pairs, axis=0, return_index=True)
    first = np.sort(first)
    walls, xy = intersections.walls[first], intersections.xy[first]
    if not len(walls):
        return WallCorners(xy, csr_array((0, 4 * len(parts))), np.empty((0, 2, 2)), walls)
    rows = [corner_rows(parts, int(i), int(j), at) for (i, j), at in zip(walls, xy, strict=True)]
    stacked = csr_array(vstack(rows))
    return WallCorners(xy, stacked, model.of_points(stacked), walls)
