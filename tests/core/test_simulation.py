"""The simulated truth itself: unit vectors, ray casting, rooms and noise against other ways to compute them."""

import numpy as np
import pytest
from core_scans import furnished_scans
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from lidarcore import SensorNoise, extract
from lidarcore.polar import cos_sin
from lidarcore.simulation import SimulatedSensor, World, furnished_room, random_pose

coordinate = st.integers(-2000, 2000).map(lambda k: k / 100)


@given(
    arrays.arrays(
        float, st.integers(0, 200), elements=st.floats(-1e5, 1e5, exclude_min=True, exclude_max=True)
    )
)
def test_cos_sin_is_cosine_and_sine(bearings):
    c, s = np.empty_like(bearings), np.empty_like(bearings)
    cos_sin(bearings, c, s)
    assert np.abs(c - np.cos(bearings)).max(initial=0) < 1.2e-15  # 1e-15 as promised, and numpy's own
    assert np.abs(s - np.sin(bearings)).max(initial=0) < 1.2e-15


def test_cos_sin_holds_at_every_octant_and_just_beside():
    octants = np.arange(-100_000, 100_000) * (np.pi / 4)
    for bearings in (octants, np.nextafter(octants, np.inf), np.nextafter(octants, -np.inf)):
        c, s = np.empty_like(bearings), np.empty_like(bearings)
        cos_sin(bearings, c, s)
        assert np.abs(c - np.cos(bearings)).max() < 1.2e-15
        assert np.abs(s - np.sin(bearings)).max() < 1.2e-15


@given(
    walls=st.lists(st.tuples(*[coordinate] * 4), min_size=1, max_size=12),
    pose=st.tuples(coordinate, coordinate, coordinate),
)
def test_rays_meet_the_nearest_wall(walls, pose):
    """Against crossings of the beam's axis, with the walls turned into the frame of each beam."""
    world = World(np.array(walls).reshape(-1, 2, 2))
    pose = np.add(pose, (0.00123, 0.00321, 0.1))  # on no wall, along none
    bearings = np.linspace(-np.pi, np.pi, 37)
    ranges, hit = world.cast(pose, bearings)
    ends = (world.walls - pose[:2]) @ [1, 1j]
    for bearing, found, wall in zip(bearings, ranges, hit, strict=True):
        a, b = (ends * np.exp(-1j * (bearing + pose[2]))).T
        assume(np.minimum(abs(a.imag), abs(b.imag)).min() > 1e-9)  # the beam does not graze an end
        crosses = a.imag * b.imag < 0
        at = np.full(len(a), np.inf)
        a, b = a[crosses], b[crosses]
        at[crosses] = a.real - a.imag * (b.real - a.real) / (b.imag - a.imag)
        at[at <= 0] = np.inf
        if np.isfinite(at.min()):
            assert found == pytest.approx(at.min(), rel=1e-9)
            assert at[wall] == pytest.approx(at.min(), rel=1e-9)
        else:
            assert np.isnan(found)
            assert wall == -1


@given(walls=st.lists(st.tuples(*[coordinate] * 4), min_size=1, max_size=5), x=coordinate, y=coordinate)
def test_clearance_is_the_distance_to_the_nearest_point_of_a_wall(walls, x, y):
    assume(all(wall[:2] != wall[2:] for wall in walls))
    world = World(np.array(walls).reshape(-1, 2, 2))
    share = np.linspace(0, 1, 4001)[:, None, None]
    points = world.walls[:, 0] + share * (world.walls[:, 1] - world.walls[:, 0])
    step = np.linalg.norm(world.walls[:, 1] - world.walls[:, 0], axis=1).max() / 4000
    sampled = np.linalg.norm(points - [x, y], axis=-1).min()
    assert sampled - step <= world.clearance(x, y) <= sampled + 1e-9


def test_random_poses_are_inside_the_room_and_clear_of_its_walls():
    room, rng = furnished_room(), np.random.default_rng(0)
    poses = np.array([random_pose(room, rng) for _ in range(300)])
    outline, boxes = room.walls[:23], room.walls[23:35].reshape(3, 4, 2, 2)
    for pose in poses:
        assert abs(winding(outline, pose)) == 1
        assert all(winding(box, pose) == 0 for box in boxes)
        ranges, _ = room.cast(pose, np.linspace(-np.pi, np.pi, 720))
        assert ranges.min() >= 0.4  # every beam meets a wall, none closer than the clearance
    assert np.ptp(poses[:, 0]) > 8
    assert np.ptp(poses[:, 1]) > 6.5


def winding(walls, pose):
    """How often a closed chain of walls goes around a point."""
    ends = (walls - pose[:2]) @ [1, 1j]
    return round(np.angle(ends[:, 1] / ends[:, 0]).sum() / (2 * np.pi))


def test_the_sensor_has_the_noise_it_says():
    rng, noise = np.random.default_rng(1), SensorNoise(0.02, 0.001)
    wall = World(np.array([[[-30.0, 3.0], [30.0, 3.0]]]))  # ahead when the sensor looks along y
    sensor = SimulatedSensor(wall, noise, beams=2000)
    errors = []
    for _ in range(100):
        scan, hit = sensor.scan(np.array([0.0, 0.0, np.pi / 2]), rng)
        square = np.abs(np.sin(scan.bearings)) < 0.02  # here a bearing error does not change the range
        square &= np.cos(scan.bearings) > 0
        assert (hit[square] == 0).all()
        errors.append(scan.ranges[square] - 3 / np.cos(scan.bearings[square]))
    errors = np.concatenate(errors)
    assert errors.std() == pytest.approx(0.02, rel=4 / np.sqrt(2 * len(errors)))
    assert errors.mean() == pytest.approx(0, abs=4 * 0.02 / np.sqrt(len(errors)))


def test_every_beam_lies_on_the_wall_it_is_said_to_meet():
    rng, room = np.random.default_rng(2), furnished_room()
    sensor = SimulatedSensor(room, SensorNoise(0.001, 0.0001))
    for _ in range(20):
        pose = random_pose(room, rng)
        scan, hit = sensor.scan(pose, rng)
        points = (
            pose[:2]
            + np.exp(1j * (scan.bearings + pose[2])).view(float).reshape(-1, 2) * scan.ranges[:, None]
        )
        start, end = room.walls[hit].transpose(1, 0, 2)
        along = (end - start) / np.linalg.norm(end - start, axis=1)[:, None]
        across = along[:, 0] * (points - start)[:, 1] - along[:, 1] * (points - start)[:, 0]
        assert np.abs(across).max() < 6 * (0.001 + 0.0001 * scan.ranges.max())


def test_noise_seen_is_the_noise_there_is():
    """The robust estimate of a scan's own noise, in a room full of corners and jumps."""
    for sigma in (0.005, 0.01, 0.02, 0.05):
        seen = [extract(scan).noise_seen for scan, _ in furnished_scans(sigma, 60, seed=3)]
        assert np.median(seen) == pytest.approx(sigma, rel=0.15)
