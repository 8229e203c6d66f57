"""The simulated robot: what it perceives is there, its odometry errs as stated, and all is the same again."""

from itertools import islice, pairwise

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.stats import chi2, norm

from lidarcore import Scan, SensorNoise
from lidarcore.errors import SimulationError
from lidarcore.geometry import compose, inverse, wrap
from lidarcore.localization import OdometryNoise
from lidarcore.simulation.posts import scattered
from lidarcore.simulation.robot import RATE, SimulatedRobot
from lidarcore.simulation.settings import OdometryError, SimulationSettings
from lidarcore.simulation.worlds import WORLDS, place

ERROR = OdometryNoise(
    along=0.04, across=0.015, heading_per_metre=0.03, heading_per_radian=0.06, slip_per_radian=0.02
)
EXACT = {"noise": SensorNoise(0.005, 1e-5), "mixed": 0.0, "dropouts": 0.0}
NARROW = 0.1  # rad, where only odometry is looked at


def scans(count: int, **settings) -> list[Scan]:
    return list(islice(SimulatedRobot(SimulationSettings(**settings)), count))


def increments(found: list[Scan]) -> tuple[np.ndarray, np.ndarray]:
    """True and measured movements (N, 3) from scan to scan, each seen from where it begins."""
    true = [compose(inverse(a.truth), b.truth) for a, b in pairwise(found)]
    measured = [compose(inverse(a.odometry), b.odometry) for a, b in pairwise(found)]
    return np.array(true), np.array(measured)


@pytest.mark.parametrize("name", WORLDS)
def test_what_is_seen_is_there(name: str) -> None:
    """Each point, put into the world from where its beam was, lies on a wall or a post within the noise."""
    robot = SimulatedRobot(SimulationSettings(world=name, **EXACT), begin=1e6)
    off = []
    for scan in islice(robot, 5, 120, 23):
        poses = robot.path(scan.stamp - 1e6 + scan.beam_times)
        beams = np.flatnonzero(scan.valid)[::7]
        angles = scan.bearings[beams] + poses[beams, 2]
        for beam, (x, y) in zip(
            beams,
            poses[beams, :2] + scan.ranges[beams, None] * np.column_stack([np.cos(angles), np.sin(angles)]),
            strict=True,
        ):
            distance = robot.place.world.clearance(x, y)
            if robot.place.posts is not None:
                to_posts = np.hypot(*(robot.place.posts.centres - [x, y]).T) - robot.place.posts.radius
                distance = min(distance, np.abs(to_posts).min())
            off.append(distance)
            assert distance < 6 * (0.005 + 1e-5 * scan.ranges[beam])
    assert len(off) > 400
    assert 0.001 < np.mean(off) < 0.005


def test_truth_stamp_and_odometry_are_of_the_first_beam_in_view() -> None:
    robot = SimulatedRobot(SimulationSettings(world="corridor", field_of_view=np.pi), begin=100.0)
    for number, scan in enumerate(islice(robot, 30)):
        x, y, heading = robot.path(np.array([scan.stamp - 100]))[0]
        assert np.allclose(scan.truth, [x, y, wrap(heading)])
        assert scan.beam_times[0] == 0
        assert scan.stamp - 100 == pytest.approx((number + 0.25) / RATE, abs=1.1e-4)
        assert np.allclose(
            scan.beam_times, (scan.bearings - scan.bearings[0]) / (2 * np.pi * RATE), atol=1e-9
        )
    assert np.allclose(scans(1)[0].odometry, scans(1)[0].truth)


def test_the_sensor_sees_what_it_is_said_to() -> None:
    half = scans(20, world="field", field_of_view=np.pi, max_range=8.0, mixed=0.0)
    assert max(np.abs(scan.bearings).max() for scan in half) <= np.pi / 2
    assert 455 <= np.mean([len(scan) for scan in half]) <= 465
    assert max(np.nanmax(scan.ranges) for scan in half) <= 8.0
    assert {int(scan.valid.sum()) > 10 for scan in half} == {True}
    assert len(scans(1)[0]) == 920


@pytest.mark.long
def test_odometry_errs_as_stated() -> None:
    """Each increment's error over its standard deviation is standard normal and independent: 5,000 of them."""
    found = scans(5001, world="corridor", field_of_view=NARROW, odometry=OdometryError(noise=ERROR), seed=3)
    true, measured = increments(found)
    error = measured - true
    error[:, 2] = wrap(error[:, 2])
    way, turn = np.hypot(true[:, 0], true[:, 1]), np.abs(true[:, 2])
    slip = 0.02**2 * turn
    variance = np.column_stack([0.04**2 * way + slip, 0.015**2 * way + slip, 0.03**2 * way + 0.06**2 * turn])
    moved = way + turn > 1e-6
    normal = error[moved] / np.sqrt(variance[moved])
    n = len(normal)
    band = norm.isf(1e-8)
    assert np.abs(normal.mean(axis=0)).max() < band / np.sqrt(n)
    low, high = chi2.ppf([1e-8, 1 - 1e-8], n) / n
    assert ((normal**2).mean(axis=0) > low).all()
    assert ((normal**2).mean(axis=0) < high).all()
    products = [normal[:, 0] * normal[:, 1], normal[:, 0] * normal[:, 2], normal[1:, 2] * normal[:-1, 2]]
    assert max(abs(product.mean()) for product in products) < band / np.sqrt(n - 1)
    turning, driving = turn[moved] > 0.02, turn[moved] < 1e-3
    for part in (normal[turning], normal[driving]):
        low, high = chi2.ppf([1e-8, 1 - 1e-8], part.size) / part.size
        assert low < (part**2).mean() < high


@pytest.mark.long
def test_errors_over_twenty_metres_are_those_of_a_random_walk() -> None:
    """Along and heading at the end of a straight line, over 60 drives, against the closed form."""
    ends = []
    for seed in range(60):
        last = scans(230, world="field", path="straight", field_of_view=NARROW, seed=seed)[-1]
        ends.append(last.odometry - last.truth)
    noise = OdometryNoise()
    low, high = np.sqrt(chi2.ppf([1e-7, 1 - 1e-7], 60) / 60)
    heading = np.sqrt((np.array(ends)[:, 2] ** 2).mean()) / (noise.heading_per_metre * np.sqrt(20))
    assert low < heading < high
    # Sideways: the integral of the heading's random walk, 20^3 / 3, and the steps' own errors.
    across = np.sqrt(noise.heading_per_metre**2 * 20**3 / 3 + noise.across**2 * 20)
    assert low < np.sqrt((np.array(ends)[:, 1] ** 2).mean()) / across < high


def test_systematic_errors_stretch_ways_and_turns() -> None:
    tiny = OdometryNoise(
        along=1e-4, across=1e-4, heading_per_metre=1e-4, heading_per_radian=1e-4, slip_per_radian=0
    )
    error = OdometryError(noise=tiny, scale=0.04, track=-0.1)
    true, measured = increments(scans(600, world="corridor", field_of_view=NARROW, odometry=error))
    way, turn = np.abs(true[:, 0]).sum(), wrap(true[:, 2]).sum()
    assert np.abs(measured[:, 0]).sum() / way == pytest.approx(1.04, abs=1e-3)
    assert wrap(measured[:, 2]).sum() / turn == pytest.approx(0.9, abs=1e-3)


def test_the_same_seed_gives_the_same_scans_and_another_one_others() -> None:
    settings = {"world": "two rooms", "people": 2, "seed": 5}
    first, again, other = scans(15, **settings), scans(15, **settings), scans(15, **{**settings, "seed": 6})
    for a, b, c in zip(first, again, other, strict=True):
        assert all(
            np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True)
            for name in ("ranges", "bearings", "beam_times", "quality", "odometry", "truth")
        )
        assert not np.array_equal(a.ranges, c.ranges, equal_nan=True)


def test_another_error_of_the_odometry_leaves_the_ranges_as_they_are() -> None:
    for a, b in zip(scans(15), scans(15, odometry=OdometryError(scale=0.1)), strict=True):
        assert np.array_equal(a.ranges, b.ranges, equal_nan=True)
        assert a is b or a.stamp == b.stamp
    assert not np.allclose(a.odometry, b.odometry)


@pytest.mark.long
@pytest.mark.parametrize("name", WORLDS)
def test_people_walk_in_every_world(name: str) -> None:
    quiet = {"world": name, "path": next(iter(WORLDS[name].paths)), **EXACT}
    empty, crowded = scans(300, **quiet), scans(300, **quiet, people=8)
    nearer = 0
    for a, b in zip(empty[::5], crowded[::5], strict=True):
        both = a.valid & b.valid
        nearer += int((b.ranges[both] < a.ranges[both] - 0.1).sum())
        assert not (b.ranges[both] > a.ranges[both] + 0.1).any()
        assert np.nanmin(b.ranges) > 0.3  # none walks into the robot
    assert nearer > 50


def test_what_does_not_exist_is_named_with_what_does() -> None:
    with pytest.raises(SimulationError, match="no world 'garden': choose one of furnished room, two rooms"):
        place("garden")
    with pytest.raises(ValidationError, match="no world 'garden'"):
        SimulationSettings(world="garden")
    with pytest.raises(ValidationError, match="Corridor has no path 'loop': choose one of there and back"):
        SimulationSettings(world="corridor", path="loop")
    for wrong in ({"max_range": 0.0}, {"field_of_view": 7.0}, {"people": -1}, {"mixed": float("nan")}):
        with pytest.raises(ValidationError, match=next(iter(wrong))):
            SimulationSettings(**wrong)


def test_scattered_posts_keep_their_distances_and_do_not_pile_up() -> None:
    way = np.column_stack([np.linspace(0, 20, 200), np.zeros(200)])
    posts = scattered(np.random.default_rng(2), 25, (0, 20, -5, 5), way, clearance=0.9, apart=1.1)
    assert np.abs(posts.centres[:, 1]).min() >= 0.89
    apart = np.linalg.norm(posts.centres[:, None] - posts.centres, axis=-1) + 99 * np.eye(25)
    assert apart.min() >= 1.1
    with pytest.raises(SimulationError, match="of 500 posts fit"):
        scattered(np.random.default_rng(2), 500, (0, 20, -5, 5), way)
