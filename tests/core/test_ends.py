"""Which beams are of which wall at a corner is decided by bearing, not by which wall a noisy beam happens to fit."""

import numpy as np
import pytest
from core_scans import closed_room, closed_scans

from lidarcore import ExtractionSettings, Scan, SensorNoise, extract
from lidarcore.simulation.rooms import polygon
from lidarcore.simulation.world import World

BEAMS = 1440
BEARINGS = 2 * np.pi * (np.arange(BEAMS) + 0.3) / BEAMS - np.pi
POSE = np.array([0.6, -0.3, 0.0])
LENGTH, WIDTH = 5.0, 3.0


def scan_of(world: World) -> tuple[Scan, np.ndarray]:
    ranges, hit = world.cast(POSE, BEARINGS)
    return Scan(ranges, BEARINGS), hit


def ends(scan: Scan, settings: ExtractionSettings) -> set[tuple[int, int]]:
    segments = extract(scan, settings).segments
    return set(zip(segments.first_beam.tolist(), segments.last_beam.tolist(), strict=True))


def stretches(hit: np.ndarray) -> set[tuple[int, int]]:
    """First and last beam of each wall, around the ring."""
    starts = np.flatnonzero(hit != np.roll(hit, 1))
    return set(zip(starts.tolist(), ((np.roll(starts, -1) - 1) % len(hit)).tolist(), strict=True))


@pytest.mark.parametrize("beyond", [1, 2])
def test_a_beam_that_fits_the_neighbour_s_line_stays_with_the_wall_it_met(beyond):
    """Beams past each corner report exactly what the wall before it, made longer, would give."""
    scan, hit = scan_of(closed_room(LENGTH, WIDTH))
    ranges, u = scan.ranges.copy(), np.column_stack([np.cos(BEARINGS), np.sin(BEARINGS)])
    for first, _ in stretches(hit):
        for beam in (first + np.arange(beyond)) % BEAMS:
            a, b = closed_room(LENGTH, WIDTH).walls[hit[first - 1]] - POSE[:2]
            normal = np.array([b[1] - a[1], a[0] - b[0]])
            ranges[beam] = (normal @ a) / (u[beam] @ normal)
    changed = ranges != scan.ranges
    assert changed.sum() == 4 * beyond
    assert (np.abs(ranges - scan.ranges)[changed] < 0.1).all()  # two sigma
    settings = ExtractionSettings(noise=SensorNoise(0.05, 0.001))
    assert ends(Scan(ranges, BEARINGS), settings) == stretches(hit)


@pytest.mark.parametrize("depth", [0.15, 0.22, 0.28])
@pytest.mark.parametrize("start", range(4))
def test_where_the_range_steps_a_wall_ends_at_the_step(depth, start):
    """A wall seen past the edge of another less than `gap` before it: their lines meet elsewhere."""
    outline = polygon(
        [(2, -1.5), (2, 0.4 + 0.01 * start), (2 + depth, 0.2), (2 + depth, 1.5), (-2, 1.5), (-2, -1.5)]
    )
    scan, hit = scan_of(World(outline - POSE[:2] * 0))
    seen = stretches(hit)
    step = next(last for _, last in seen if hit[last] == 1 or (hit[last] == 0))
    assert abs(scan.ranges[step] - scan.ranges[(step + 1) % BEAMS]) > 0.1
    found = ends(scan, ExtractionSettings(noise=SensorNoise(0.02, 0.001)))
    assert step in {last for _, last in found}
    assert (step + 1) % BEAMS in {first for first, _ in found}


@pytest.mark.parametrize("sigma", [0.02, 0.03, 0.05])
def test_walls_end_where_their_corner_is_seen(sigma):
    """The last beam of one wall and the first of the next lie to either side of the corner, give or take a beam."""
    settings = ExtractionSettings(noise=SensorNoise(sigma, 0.001))
    off = []
    for scan, _ in closed_scans(LENGTH, WIDTH, sigma, 100, seed=21):
        features = extract(scan, settings)
        segments, corners = features.segments, features.corners
        for (j, k), (x, y) in zip(corners.segments, corners.xy, strict=True):
            last, first = segments.last_beam[j], segments.first_beam[k]
            if (last + 1) % len(scan) != first:
                continue  # a gap in a wall seen at a grazing angle
            before, after = np.angle(np.exp(1j * (np.arctan2(y, x) - scan.bearings[[last, first]])))
            off.append(max(-before, after, 0) * len(scan) / (2 * np.pi))
    off = np.array(off)
    share = (off > 1).mean()
    print(
        f"\n{sigma:.2f} m: {len(off)} corners, {share:.4f} of them off by more than a beam, {off.max():.2f} at most"
    )
    assert len(off) > 300
    assert share < 0.02
