"""Routes: as fast as the limits allow and no faster, without jumps, where they were told to go."""

import numpy as np
import pytest

from lidarcore.simulation.routes import Limits, Route, drive, drive_round, drive_there_and_back
from lidarcore.simulation.worlds import WORLDS

STEP = 0.002  # s
LIMITS = Limits(speed=0.7, turn_rate=0.9, acceleration=0.4)
CURVE = np.column_stack([np.linspace(0, 12, 400), np.sin(np.linspace(0, 12, 400))])
SQUARE = [(0, 0), (6, 0), (6, 4), (0, 4)]
SIDE = (2.0, 0)
ROUTES = {
    "one way": drive(CURVE, LIMITS),
    "round": drive_round([SIDE, *SQUARE[1:], SQUARE[0]], 2.0, LIMITS),
    "there and back": drive_there_and_back(CURVE, LIMITS),
}


@pytest.mark.parametrize("route", ROUTES.values(), ids=ROUTES)
def test_limits_are_kept(route: Route) -> None:
    poses = route(np.arange(0, 2.2 * route.duration, STEP))
    speed = np.hypot(*np.diff(poses[:, :2], axis=0).T) / STEP
    turn_rate = np.abs((np.diff(poses[:, 2]) + np.pi) % (2 * np.pi) - np.pi) / STEP
    assert speed.max() == pytest.approx(LIMITS.speed, rel=0.01)
    assert turn_rate.max() < 1.01 * LIMITS.turn_rate


def test_a_straight_way_takes_as_long_as_the_limits_demand() -> None:
    """Half way up and half way down: s / v + v / a; too short to reach full speed, 2 sqrt(s / a)."""
    assert drive([(0, 0), (9, 0)], LIMITS).duration == pytest.approx(9 / 0.7 + 0.7 / 0.4, rel=1e-3)
    assert drive([(0, 0), (0.5, 0)], LIMITS).duration == pytest.approx(2 * np.sqrt(0.5 / 0.4), rel=1e-3)


def test_on_a_straight_way_the_speed_changes_no_faster_than_allowed() -> None:
    speed = np.diff(drive([(0, 0), (9, 0)], LIMITS)(np.arange(0, 15, 0.05))[:, 0]) / 0.05
    assert np.abs(np.diff(speed)).max() / 0.05 < 1.05 * LIMITS.acceleration


@pytest.mark.parametrize("route", ROUTES.values(), ids=ROUTES)
def test_the_robot_looks_where_it_drives(route: Route) -> None:
    poses = route(np.arange(0, route.duration, STEP))
    step = np.diff(poses[:, :2], axis=0)
    moving = np.hypot(*step.T) > 1e-4
    off = np.arctan2(step[:, 1], step[:, 0]) - (poses[:-1, 2] + poses[1:, 2]) / 2
    assert np.abs(np.angle(np.exp(1j * off[moving]))).max() < 0.02


def test_a_way_is_driven_from_end_to_end_and_then_stands() -> None:
    route = ROUTES["one way"]
    assert np.allclose(route(np.array([0.0, 1e3]))[:, :2], CURVE[[0, -1]])
    way = route(np.arange(0, route.duration, 0.05))
    assert np.abs(way[:, 1] - np.sin(way[:, 0])).max() < 1e-3


@pytest.mark.parametrize("route", ROUTES.values(), ids=ROUTES)
def test_a_route_begins_and_ends_at_rest(route: Route) -> None:
    """A filter that takes the first scan for one of a standing sensor is right."""
    for end in (0.0, route.duration - 0.05):
        first, last = route(np.array([end, end + 0.049]))
        assert np.hypot(*(last - first)[:2]) < LIMITS.acceleration * 0.05**2
        assert abs(last[2] - first[2]) < 0.005


def test_there_and_back_passes_every_place_in_both_directions() -> None:
    route = ROUTES["there and back"]
    poses = route(np.linspace(0, route.duration, 4000, endpoint=False))
    there, back = poses[:2000], poses[2000:]
    assert np.abs(poses[:, 1] - np.sin(poses[:, 0])).max() < 1e-3
    for x in np.linspace(0.5, 11.5, 23):
        ahead = np.interp(x, there[:, 0], there[:, 2])
        assert np.interp(x, back[::-1, 0], back[::-1, 2]) - ahead == pytest.approx(np.pi, abs=0.02)
    assert np.allclose(poses[-1] - poses[0], [0, 0, 2 * np.pi], atol=0.02)


def test_a_round_closes_and_cuts_corners_only() -> None:
    route = ROUTES["round"]
    poses = route(np.linspace(0, route.duration, 2000))
    x, y = poses[:, 0], poses[:, 1]
    to_side = np.min([np.abs(x), np.abs(x - 6), np.abs(y), np.abs(y - 4)], axis=0)
    corner = np.min([np.hypot(x - a, y - b) for a, b in SQUARE], axis=0)
    assert to_side[corner > 1.05].max() < 1e-6
    assert to_side.max() == pytest.approx(1 / 6, rel=0.05)  # a triangular mean over 2 m of the way
    assert np.allclose(route(np.array([0.3])), route(np.array([0.3 + route.duration])))


@pytest.mark.parametrize(
    ("world", "name"), [(place.name, name) for place in WORLDS.values() for name in place.paths]
)
def test_every_path_of_every_world_is_clear(world: str, name: str) -> None:
    place = WORLDS[world]
    poses = place.path(name)(np.arange(0, 120, 0.2))
    assert min(place.world.clearance(*pose[:2]) for pose in poses) > 0.5
    if place.posts is not None:
        to_posts = np.linalg.norm(poses[:, None, :2] - place.posts.centres, axis=-1)
        assert to_posts.min() > 0.7
    assert np.ptp(poses[:, 0]) > 5 or name == "standing"
