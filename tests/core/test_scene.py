"""The living room of the emulated sensor: people, a moving sensor and imperfect beams, each against another way."""

import numpy as np
import pytest

from lidarcore import SensorNoise
from lidarcore.simulation import World, furnished_room
from lidarcore.simulation.paths import ROUND, standing, wandering
from lidarcore.simulation.people import LEG, Person
from lidarcore.simulation.posts import distances_to_circles
from lidarcore.simulation.rooms import rectangular_room
from lidarcore.simulation.scene import Optics, Scene

ROOM = furnished_room()
MINUTES = np.arange(0, 600, 0.02)
FULL_TURN = np.linspace(-np.pi, np.pi, 926, endpoint=False)


@pytest.fixture(scope="module")
def walk():
    """Both legs of one person for ten minutes, (2, N, 2) m."""
    person = Person(ROOM, np.random.default_rng(1), wandering(np.linspace(0, 2 * ROUND, 200))[:, :2])
    return np.concatenate([person.legs(part) for part in np.split(MINUTES, 100)], axis=1)


def test_a_moving_sensor_sees_from_where_each_beam_is():
    poses = wandering(np.linspace(0, 30, len(FULL_TURN)))
    ranges, hit = ROOM.cast(poses, FULL_TURN)
    for k in range(0, len(FULL_TURN), 25):
        alone, wall = ROOM.cast(poses[k], FULL_TURN[k : k + 1])
        assert (ranges[k], hit[k]) == (alone[0], wall[0])


def test_the_path_of_the_sensor_is_smooth_closed_and_clear_of_the_furniture():
    poses = wandering(np.linspace(0, 2 * ROUND, 20001))
    assert np.abs(poses[0] - poses[-1]).max() < 1e-9
    speed = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1) * 20000 / (2 * ROUND)
    assert speed.min() > 0.02
    assert speed.max() < 0.3
    assert min(ROOM.clearance(*pose[:2]) for pose in poses[::50]) > 0.5
    assert (standing(MINUTES) == standing(np.zeros(1))).all()


def test_people_walk_as_people_do(walk):
    middle = walk.mean(axis=0)
    speed = np.linalg.norm(np.diff(middle, axis=0), axis=1) / 0.02
    assert speed.max() < 2  # m/s: nobody jumps, nobody runs
    walking = speed > 0.1
    assert 0.3 < walking.mean() < 0.95  # now and then they stand
    assert 0.8 < np.median(speed[walking]) < 1.4
    apart = np.linalg.norm(walk[0] - walk[1], axis=1)
    assert apart.min() > 2 * LEG
    assert apart.max() < 0.7
    assert np.ptp(middle, axis=0).min() > 4  # they see more of the room than a corner


def test_people_walk_through_neither_walls_nor_the_sensor(walk):
    middle = walk.mean(axis=0)
    assert min(ROOM.clearance(*at) for at in middle[::10]) > 0.3
    path = wandering(np.linspace(0, 2 * ROUND, 200))[:, :2]
    assert np.linalg.norm(middle[::10, None] - path, axis=-1).min() > 0.55


def test_the_walk_is_the_same_however_it_is_asked_for(walk):
    person = Person(ROOM, np.random.default_rng(1), wandering(np.linspace(0, 2 * ROUND, 200))[:, :2])
    assert np.allclose(person.legs(MINUTES), walk, atol=1e-12)


def test_legs_are_circles():
    """Against beams cast at polygons of 720 sides."""
    rng = np.random.default_rng(2)
    centres = rng.uniform((0.5, -2), (3, 2), (5, 2))
    corners = centres[:, None] + LEG * np.exp(1j * np.linspace(0, 2 * np.pi, 720)).view(float).reshape(-1, 2)
    polygons = World(np.stack([corners, np.roll(corners, -1, axis=1)], 2).reshape(-1, 2, 2))
    directions = np.exp(1j * FULL_TURN).view(float).reshape(-1, 2)
    legs = np.repeat(centres[:, None], len(FULL_TURN), axis=1)
    found = distances_to_circles(legs, LEG, np.zeros((len(FULL_TURN), 2)), directions)
    expected = np.nan_to_num(polygons.cast(np.zeros(3), FULL_TURN)[0], nan=np.inf)
    meets = np.isfinite(expected)
    assert np.isfinite(found[meets]).mean() > 0.98  # but for beams that graze
    both = meets & np.isfinite(found)
    assert both.sum() > 30
    assert np.abs(found[both] - expected[both]).max() < 1e-3


def test_who_stands_in_the_way_hides_the_wall():
    people = [Person(ROOM, np.random.default_rng(seed), np.array([[4.5, 4.0]])) for seed in range(4)]
    crowded, empty = Scene(ROOM, standing, people), Scene(ROOM, standing)
    hidden = []
    for begin in np.arange(0, 60, 0.1):
        times = begin + np.arange(len(FULL_TURN)) * 108e-6
        (seen, _), (wall, _) = crowded.cast(times, FULL_TURN), empty.cast(times, FULL_TURN)
        assert (seen <= wall).all()
        hidden.append((seen < wall).sum())
    assert 10 < np.mean(hidden) < 300


def observed(optics, n=200):
    """True and observed ranges, sines and quality of n turns, (n, 926) each."""
    rng = np.random.default_rng(3)
    ranges, sines = Scene(ROOM, standing).cast(np.zeros(len(FULL_TURN)), FULL_TURN)
    seen, quality = (
        np.array(rows) for rows in zip(*(optics.observe(ranges, sines, rng) for _ in range(n)), strict=True)
    )
    return ranges, sines, seen, quality


def test_beams_at_an_edge_report_something_in_between():
    ranges, _, seen, _ = observed(Optics(SensorNoise(1e-6, 1e-6), mixed=0.5, dropouts=0, grazing=0))
    step = np.diff(ranges, append=ranges[-1])
    edge = np.abs(step) > 0.15
    assert edge.sum() >= 8
    assert np.abs(seen - ranges)[:, ~edge].max() < 1e-4
    share = ((seen - ranges) / np.where(edge, step, 1))[:, edge]
    mixed = np.abs(share) > 1e-4
    assert mixed.mean() == pytest.approx(0.5, abs=0.05)
    assert (share[mixed] > 0).all()
    assert (share[mixed] < 1).all()
    assert share[mixed].mean() == pytest.approx(0.5, abs=0.05)


def test_along_a_wall_at_a_slant_there_are_no_edges():
    """Ranges grow there by more than at an edge, from one beam to the next."""
    hall, here = rectangular_room(42, 26), np.array([9.0, -5.0, 0.3])
    ranges, sines = Scene(hall, lambda times: np.tile(here, (len(times), 1))).cast(0 * FULL_TURN, FULL_TURN)
    assert (np.abs(np.diff(ranges)) > 0.15).sum() > 100
    optics = Optics(SensorNoise(1e-6, 1e-6), mixed=1.0, dropouts=0, grazing=0)
    seen, _ = optics.observe(ranges, sines, np.random.default_rng(0))
    assert (np.abs(seen - ranges) > 1e-4).sum() <= 4  # where two walls meet


def test_noise_dropouts_and_limits_are_those_asked_for():
    ranges, _, seen, quality = observed(
        Optics(SensorNoise(0.02, 1e-6), mixed=0, dropouts=0.1, grazing=0, limits=(0.1, 4.5))
    )
    within = ranges < 4.4
    assert np.isnan(seen[:, within]).mean() == pytest.approx(0.1, abs=0.01)
    assert np.nanstd((seen - ranges)[:, within]) == pytest.approx(0.02, rel=0.02)
    assert np.isnan(seen[:, ranges > 4.6]).all()
    assert ((quality == 0) == np.isnan(seen)).all()
    assert quality.max() <= 63


def test_the_weaker_the_return_the_lower_its_quality_and_grazing_beams_have_none():
    ranges, sines, seen, quality = observed(
        Optics(SensorNoise(0.001, 1e-6), mixed=0, dropouts=0, grazing=0.3), 3
    )
    assert (np.isnan(seen) == (sines < 0.3)).all()
    assert 0 < np.isnan(seen).mean() < 0.5
    near, far = np.isfinite(seen[0]) & (ranges < 3), np.isfinite(seen[0]) & (ranges > 5)
    assert quality[0, near].mean() > quality[0, far].mean()
    steep, flat = (sines > 0.9) & near, (sines < 0.6) & near
    assert quality[0, steep].mean() > quality[0, flat].mean()
