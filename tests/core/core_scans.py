"""Scans to extract from, how they are changed, and how features of two scans compare."""

import numpy as np

from lidarcore import Features, Scan, SensorNoise
from lidarcore.simulation import SimulatedSensor, World, furnished_room, random_pose


def closed_room(length: float, width: float) -> World:
    """Four walls around the origin and nothing else: no beam is lost, no range jumps."""
    x, y = length / 2, width / 2
    corners = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
    return World(np.stack([corners, np.roll(corners, -1, axis=0)], 1))


def closed_scans(length, width, sigma_range, n, seed):
    """(scan, hit) from random poses at least 0.4 m from the walls of a closed room."""
    rng = np.random.default_rng(seed)
    sensor = SimulatedSensor(closed_room(length, width), SensorNoise(sigma_range, 0.001))
    for _ in range(n):
        x, y = rng.uniform(-0.5, 0.5, 2) * [length - 0.8, width - 0.8]
        yield sensor.scan(np.array([x, y, rng.uniform(-np.pi, np.pi)]), rng)


def furnished_scans(sigma_range, n, seed, missing=0.0):
    """(scan, hit) from random poses in the furnished room, a share of the beams without return."""
    rng, room = np.random.default_rng(seed), furnished_room()
    sensor = SimulatedSensor(room, SensorNoise(sigma_range, 0.001))
    for _ in range(n):
        scan, hit = sensor.scan(random_pose(room, rng), rng)
        lost = rng.random(len(scan)) < missing
        yield Scan(np.where(lost, np.nan, scan.ranges), scan.bearings), hit


def rolled(scan: Scan, k: int) -> Scan:
    """The same ring, started k beams later."""
    return Scan(np.roll(scan.ranges, -k), np.roll(scan.bearings, -k))


def covered(features: Features) -> list[np.ndarray]:
    """Beams that each segment covers, along the ring."""
    n = len(features.scan)
    segments = features.segments
    return [ring(a, b, n) for a, b in zip(segments.first_beam, segments.last_beam, strict=True)]


def ring(first: int, last: int, n: int) -> np.ndarray:
    return np.arange(first, last + 1 + n * (last < first)) % n


def table(features: Features, shift: int = 0) -> tuple[np.ndarray, np.ndarray, list[tuple]]:
    """Segments, corners and rejections, in an order that does not depend on where the ring starts.

    shift is added to the indices of beams.
    """
    n, s, c = len(features.scan), features.segments, features.corners
    first, last = (s.first_beam + shift) % n, (s.last_beam + shift) % n
    lines, M, K = s.lines, len(s), len(c)
    rows = np.column_stack(
        [
            first, last, s.n_points, s.start, s.end, lines.r, np.cos(lines.alpha), np.sin(lines.alpha),
            lines.covariance_published.reshape(M, 4), lines.covariance_consistent.reshape(M, 4), s.rms,
        ]
    )  # fmt: skip
    meeting = first[c.segments] if K else np.empty((0, 2))
    corners = np.column_stack(
        [meeting, c.xy, c.angle, c.covariance_published.reshape(K, 4), c.covariance_consistent.reshape(K, 4)]
    )
    rejections = sorted(
        (r.kind, (r.first_beam + shift) % n, (r.last_beam + shift) % n, r.reason, round(r.value, 9))
        for r in features.rejections
    )
    return rows[np.argsort(first)], corners[np.lexsort(meeting.T)], rejections


def assert_same_features(found: Features, expected: Features, shift: int = 0) -> None:
    for a, b in zip(table(found, shift), table(expected), strict=True):
        if isinstance(a, list):
            assert a == b
        else:
            assert a.shape == b.shape
            np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)
