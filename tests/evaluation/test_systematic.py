"""Range bias and alignment against simulated truth: walls that are uneven, in rooms of several shapes."""

import csv
import gzip
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby, islice, product

import numpy as np
import pytest
from chance import RATE, fewest, holds
from scipy.stats import ttest_1samp

from lidarcore import Scan, SensorNoise
from lidarcore.evaluation.calibration.calibrate import calibrate
from lidarcore.evaluation.calibration.systematic import alignment, range_bias, wall_shapes
from lidarcore.evaluation.calibration.wall_beams import beams_on_walls
from lidarcore.simulation import SimulatedSensor, furnished_room, random_pose
from lidarcore.simulation.rooms import polygon, rectangular_room
from lidarcore.simulation.world import World

NOISE = SensorNoise(0.01, 0.001)
POSE = np.array([0.5, 0.3, 0.2])
ROOMS = {
    "furnished": furnished_room(),
    "rectangle": rectangular_room(4.5, 2.5),
    "L": World(polygon(((0, 0), (6, 0), (6, 3), (3, 3), (3, 5), (0, 5)))),
}
TRIANGLE = World(polygon([(3 * np.cos(a), 3 * np.sin(a)) for a in np.arange(3) * 2 * np.pi / 3]))
SCANS = 20


def uneven(world, rng, amplitude=0.002):
    """What a wall sticks out by (m, along its normal) where a beam meets it: waves of its own for each wall."""
    heights, phases = (
        rng.normal(0, amplitude, (len(world.walls), 3)),
        rng.uniform(0, 7, (len(world.walls), 3)),
    )
    waves = rng.uniform(1, 12, (len(world.walls), 3))  # rad / m
    return lambda wall, along: (heights[wall] * np.sin(waves[wall] * along[:, None] + phases[wall])).sum(1)


def standing(world, pose, rng, bias=0.0, bumps=None, noise=NOISE, scans=SCANS):
    """Scans of a sensor whose ranges are all too long by the bias, before walls with bumps."""
    sensor, taken = SimulatedSensor(world, noise), []
    for _ in range(scans):
        scan, wall = sensor.scan(pose, rng)
        ranges = scan.ranges + bias
        if bumps is not None:
            start, ends = world.walls[wall, 0], np.diff(world.walls[wall], axis=1)[:, 0]
            length, angle = np.linalg.norm(ends, axis=1), scan.bearings + pose[2]
            beam = np.column_stack([np.cos(angle), np.sin(angle)])
            along = ((pose[:2] + scan.ranges[:, None] * beam - start) * ends).sum(1) / length
            sine = np.abs(ends[:, 0] * beam[:, 1] - ends[:, 1] * beam[:, 0]) / length
            ranges = ranges + bumps(wall, along) / np.maximum(sine, 0.05)
        taken.append(replace(scan, ranges=ranges))
    return taken


def quarter(angle):
    return (angle + np.pi / 4) % (np.pi / 2) - np.pi / 4


def test_intervals_hold_the_truth_about_as_often_as_they_say():
    held, errors, widths = [], [], []
    for seed, (world, bias) in enumerate([*product(ROOMS.values(), (0.0, 0.03))] * 10):
        rng = np.random.default_rng(seed)
        pose = random_pose(world, rng)
        beams = beams_on_walls(standing(world, pose, rng, bias, uneven(world, rng)))
        walls = wall_shapes(beams[beams.near()], NOISE.sigma_bearing)
        found, turned = range_bias(walls), alignment(walls, bias)
        off = quarter(turned.value + pose[2])
        held.append([found.contains(bias), abs(off) <= turned.half_width])
        errors.append([found.value - bias, off])
        widths.append([found.half_width, turned.half_width])
    share, rms = np.mean(held, axis=0), np.sqrt(np.mean(np.square(errors), axis=0))
    print(f"held {share}, rms {rms}, median half-width {np.median(widths, axis=0)} m and rad")
    assert (share * len(held) >= fewest(len(held), 0.95)).all()  # intervals that hold 0.7 would be caught
    assert (np.median(widths, axis=0) < 4 * rms).all()  # no interval is right by being endless


@pytest.mark.parametrize("bias", [-0.05, 0.0, 0.04])
def test_calibration_finds_a_bias_where_walls_are_straight_and_long(bias):
    found = calibrate(standing(ROOMS["rectangle"], POSE, np.random.default_rng(1), bias, scans=60))
    print(found.range_bias, found.alignment)
    assert holds(found.range_bias, bias)
    assert found.range_bias.half_width < 0.005
    assert found.range_bias.contains(0.0) == (bias == 0.0)
    assert holds(found.alignment, -POSE[2])
    assert found.alignment.half_width < 0.002


def test_bearings_that_scatter_much_are_no_bias():
    """Such a wall looks bent outwards by its curvature, which would pass for a bias of 2.4 mm."""
    noise, found = SensorNoise(0.005, 0.02), []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        pose = random_pose(ROOMS["rectangle"], rng)
        beams = beams_on_walls(standing(ROOMS["rectangle"], pose, rng, noise=noise, scans=40))
        found.append(range_bias(wall_shapes(beams[beams.near()], noise.sigma_bearing)).value)
    assert ttest_1samp(found, 0.0).pvalue > RATE
    assert np.std(found) < 0.0015


def test_an_offset_of_the_bearings_is_seen_against_the_walls():
    """Housing square to the walls, bearings off by 3 degrees."""
    offset, rng = np.radians(3.0), np.random.default_rng(3)
    scans = standing(ROOMS["furnished"], np.array([4.5, 4.0, 0.0]), rng)
    turned = [
        Scan(scan.ranges, (scan.bearings + offset + np.pi) % (2 * np.pi) - np.pi, scan.stamp)
        for scan in scans
    ]
    found = calibrate(turned).alignment
    print(found)
    assert holds(found, offset)
    assert found.half_width < 0.003


def test_a_factor_in_all_ranges_is_not_taken_for_a_bias():
    """The picture is a larger one, with straight walls."""
    scans = standing(ROOMS["rectangle"], POSE, np.random.default_rng(4))
    plain, larger = (
        calibrate(replace(scan, ranges=factor * scan.ranges) for scan in scans).range_bias
        for factor in (1, 1.02)
    )
    assert larger.value == pytest.approx(plain.value, abs=2e-4)
    assert holds(larger, 0.0)


@pytest.mark.long
@pytest.mark.parametrize("turn", np.radians([-44, -1, 0, 30, 46, 91, 179]))
def test_alignment_is_known_up_to_quarter_turns(turn):
    pose = np.array([0.5, 0.3, -turn])
    found = calibrate(standing(ROOMS["rectangle"], pose, np.random.default_rng(5))).alignment
    assert -np.pi / 4 <= found.value < np.pi / 4
    assert holds(found, found.value - quarter(found.value - turn))


def test_walls_at_other_angles_have_no_alignment():
    found = calibrate(standing(TRIANGLE, np.array([0.2, 0.1, 0.3]), np.random.default_rng(6)))
    assert found.alignment is None
    assert holds(found.range_bias, 0.0)


def test_between_two_walls_neither_can_be_told():
    corridor = World(np.array([[[-4.0, -1.0], [4.0, -1.0]], [[4.0, 1.5], [-4.0, 1.5]]]))
    found = calibrate(standing(corridor, POSE, np.random.default_rng(7)))
    assert found.walls == 2
    assert found.range_bias is None
    assert found.alignment is None
    assert holds(found.sigma_range, NOISE.sigma_range)


def stations(path) -> Iterator[list[Scan]]:
    with gzip.open(path, "rt") as file:
        for _, rows in groupby(csv.DictReader(file), key=lambda row: row["station"]):
            scans = []
            for _, samples in groupby(rows, key=lambda row: row["rev"]):
                mm, degrees = np.array([(row["distance_mm"], row["angle_deg"]) for row in samples], float).T
                scans.append(Scan(mm / 1e3, np.radians(-degrees)))
            yield scans


@pytest.mark.long
@pytest.mark.real_data
def test_both_halves_of_real_stations_tell_the_same(data):
    """Nobody knows the bias of that sensor; but its halves share it, and the few short walls show little of it."""
    for scans in islice(stations(data / "rplidar_csv_rooms" / "mapping_keng.csv.gz"), 3):
        one, other = calibrate(scans[::2]), calibrate(scans[1::2])
        for a, b in ((one.range_bias, other.range_bias), (one.alignment, other.alignment)):
            print(a, b)
            assert max(a.low, b.low) <= min(a.high, b.high)
        assert one.range_bias.half_width > 0.01
        assert one.alignment.half_width < np.radians(3)
