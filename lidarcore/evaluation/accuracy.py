"""Which walls and corners of a known room are found, and how well: recall, precision, corner error."""

from dataclasses import dataclass, field

import numpy as np

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.extraction import extract
from lidarcore.features import Features, Segments
from lidarcore.geometry import act_inverse, left_of, unit_vectors
from lidarcore.noise import SensorNoise
from lidarcore.settings import ExtractionSettings
from lidarcore.simulation import SimulatedSensor, furnished_room, random_pose
from lidarcore.simulation.world import World

MIN_BEAMS, MIN_EXTENT = 8, 0.4  # a stretch of wall counts as visible from this many beams and metres on
CORNER_RADIUS = 0.15  # a corner farther than this (m) from the true one is another


@dataclass(slots=True)
class Accuracy:
    """Counts over many scans, and the figures made of them."""

    visible: int = 0
    found: int = 0
    segments: int = 0
    matched: int = 0
    seam_walls: int = 0
    seam_splits: int = 0
    visible_corners: int = 0
    corner_errors: list[float] = field(default_factory=list)

    @property
    def recall(self) -> float:
        """Share of visible walls that a segment lies on."""
        return self.found / self.visible

    @property
    def precision(self) -> float:
        """Share of segments that lie on a wall."""
        return self.matched / self.segments

    @property
    def corner_recall(self) -> float:
        """Share of visible corners with a corner found within CORNER_RADIUS."""
        return len(self.corner_errors) / self.visible_corners

    @property
    def corner_rms(self) -> float:
        """Root mean square distance (m) of the found corners from the true ones."""
        return float(np.sqrt(np.mean(np.square(self.corner_errors))))


_View = tuple[int, Ints]
"""A wall, and a stretch of beams (n,) that meet it."""


def measure_accuracy(sigma_range: float, scans: int, seed: int) -> Accuracy:
    """Scans of the furnished room from random poses, against what can be seen in it.

    sigma_range in m; the bearing noise is 0.001 rad. Both are told to the extraction, all else is default.
    """
    rng, world, result = np.random.default_rng(seed), furnished_room(), Accuracy()
    sensor = SimulatedSensor(world, SensorNoise(sigma_range, 0.001))
    settings = ExtractionSettings(noise=sensor.noise)
    for _ in range(scans):
        pose = random_pose(world, rng)
        scan, hit = sensor.scan(pose, rng)
        _count(result, world, pose, hit, extract(scan, settings), scan.bearings)
    return result


def _count(
    result: Accuracy, world: World, pose: Array, hit: Ints, features: Features, bearings: Array
) -> None:
    walls = act_inverse(pose, world.walls)
    segments = features.segments
    tolerance = 0.03 + 3 * features.settings.noise.sigma_range
    on_wall = _lies_on(segments.start, segments.end, walls, tolerance)
    covered = _covered_beams(segments, len(hit))
    result.segments += len(segments)
    result.matched += int(on_wall.any(1).sum())
    views = _views(walls, hit, bearings)
    for wall, beams in views:
        finders = covered[:, beams].sum(1) * 2 > len(beams)
        result.visible += 1
        result.found += int((finders & on_wall[:, wall]).any())
        if {0, len(hit) - 1} <= set(beams):
            result.seam_walls += 1
            parts = on_wall[:, wall] & covered[:, beams].any(1)
            result.seam_splits += int(parts.sum() > 1 and not (parts & covered[:, 0] & covered[:, -1]).any())
    for corner in _visible_corners(walls, views, len(hit)):
        result.visible_corners += 1
        distances = np.linalg.norm(features.corners.xy - corner, axis=1)
        if len(distances) and distances.min() < CORNER_RADIUS:
            result.corner_errors.append(float(distances.min()))


def _lies_on(start: Array, end: Array, walls: Array, tolerance: float) -> Bools:
    """(M, W) true where both ends of a segment are within tolerance of a wall, and its middle is on it."""
    origin, along = walls[:, 0], walls[:, 1] - walls[:, 0]
    length = np.linalg.norm(along, axis=1)
    tangent = along / length[:, None]
    normal = left_of(tangent)
    across = [np.abs(((p[:, None] - origin) * normal).sum(-1)) for p in (start, end)]
    middle = (((start + end)[:, None] / 2 - origin) * tangent).sum(-1)
    return (np.maximum(*across) < tolerance) & (middle > 0) & (middle < length)


def _covered_beams(segments: Segments, beams: int) -> Bools:
    """(M, N) true where a segment covers a beam."""
    first, last = segments.first_beam[:, None], segments.last_beam[:, None]
    k = np.arange(beams)
    return np.where(first <= last, (first <= k) & (k <= last), (first <= k) | (k <= last))


def _views(walls: Array, hit: Ints, bearings: Array) -> list[_View]:
    """Each stretch of neighbouring beams that meet one wall, if it has enough beams and is long enough."""
    starts = np.flatnonzero(hit != np.roll(hit, 1))
    views = []
    for start, stop in zip(starts, np.append(starts[1:], starts[:1] + len(hit)), strict=True):
        beams = np.arange(start, stop) % len(hit)
        wall = int(hit[start])
        if wall >= 0 and len(beams) >= MIN_BEAMS and _extent(walls[wall], bearings[beams]) >= MIN_EXTENT:
            views.append((wall, beams))
    return views


def _extent(wall: Array, bearings: Array) -> float:
    """Length (m) of the part of a wall between beams at these bearings."""
    tangent = (wall[1] - wall[0]) / np.linalg.norm(wall[1] - wall[0])
    normal = left_of(tangent)
    u = unit_vectors(bearings)
    return float(np.ptp((wall[0] @ normal) / (u @ normal) * (u @ tangent)))


def _visible_corners(walls: Array, views: list[_View], beams: int) -> list[Array]:
    """Ends that two walls share where their views are neighbours."""
    corners = []
    for (one, of_one), (other, of_other) in zip(views, views[1:] + views[:1], strict=True):
        if (of_one[-1] + 1) % beams == of_other[0]:
            corners += [p for p in walls[one] for q in walls[other] if np.allclose(p, q, atol=1e-9)]
    return corners
