"""Patches, surfels and how a scan is registered on them, against known motion, brute force and finite differences."""

from itertools import islice

import numpy as np
import pytest
from mapping_scenes import NOISE, full_scan, sick_scan
from scipy.spatial import cKDTree

from lidarcore import Scan
from lidarcore.geometry import act, act_inverse, compose, pose_difference, relative, rotate
from lidarcore.mapping import MatchSettings
from lidarcore.mapping.cells import cells
from lidarcore.mapping.matching.correlative import candidates, search
from lidarcore.mapping.matching.patches import joined, patches, placed
from lidarcore.mapping.matching.registration import linearised, register
from lidarcore.mapping.matching.surfels import nearest, surfels
from lidarcore.simulation import World, furnished_room, random_pose
from lidarcore.simulation.rooms import rectangular_room

MATCH = MatchSettings(noise=NOISE)
ROOM = furnished_room()


def map_of(scans, poses=None):
    poses = np.zeros((len(scans), 3)) if poses is None else poses
    seen = [placed(patches(scan, MATCH), pose) for scan, pose in zip(scans, poses, strict=True)]
    return surfels(joined(seen), MATCH.patch, MATCH.reach)


@pytest.mark.parametrize("scanned", [full_scan, sick_scan])
def test_patches_lie_on_walls_with_their_normals_towards_the_sensor(scanned):
    rng = np.random.default_rng(1)
    pose = random_pose(ROOM, rng)
    seen = patches(scanned(ROOM, pose, NOISE, rng), MATCH)
    assert len(seen.means) > 30
    distances = [ROOM.clearance(*point) for point in act(pose, seen.means)]
    assert np.median(distances) < 0.02
    assert np.percentile(distances, 95) < 0.08
    assert ((seen.means * seen.normals).sum(1) < 0).mean() > 0.95
    np.testing.assert_allclose(np.hypot(*seen.normals.T), 1)


def test_the_nearest_surfel_is_the_one_that_brute_force_finds():
    rng = np.random.default_rng(2)
    map = map_of([full_scan(ROOM, random_pose(ROOM, rng), NOISE, rng)])
    places = map.means[rng.integers(len(map.means), size=300)] + rng.normal(0, 0.2, (300, 2))
    normals = rng.normal(size=(300, 2))
    normals /= np.hypot(*normals.T)[:, None]
    for place, normal in zip(places, normals, strict=True):
        distance = np.hypot(*(map.means - place).T)
        allowed = (map.normals @ normal > 0.8) & (distance < MATCH.reach)
        found = nearest(map, *place, *normal, MATCH.reach, 0.8)
        assert found == (np.argmin(np.where(allowed, distance, np.inf)) if allowed.any() else -1)


def test_a_scan_is_laid_where_it_was_taken():
    rng = np.random.default_rng(3)
    errors = []
    for _ in range(40):
        pose = random_pose(ROOM, rng)
        step = rng.normal(0, [0.1, 0.1, 0.05])
        map = map_of([full_scan(ROOM, pose, NOISE, rng)])
        scan = patches(full_scan(ROOM, compose(pose, step), NOISE, rng), MATCH)
        registered = register(map, scan, np.zeros(3), np.zeros(3), np.diag([10.0, 10, 10]), MATCH.reach)
        assert registered.inliers > 0.7
        errors.append(pose_difference(registered.pose, step))
    assert np.sqrt(np.mean(np.square(errors)[:, :2].sum(1))) < 0.006


def test_along_a_corridor_the_guess_decides():
    """Errors of the normals look like information there; they must not be taken for any."""
    rng, corridor = np.random.default_rng(4), rectangular_room(120, 2.4)
    prior, claims = np.diag([0.1, 0.1, 0.05]) ** 2, []
    for _ in range(20):
        pose = np.array([rng.uniform(-5, 5), rng.uniform(-0.5, 0.5), 0.0])
        map = map_of([sick_scan(corridor, pose, NOISE, rng)])
        guess = rng.normal(0, [0.1, 0.1, 0.05])
        scan = patches(sick_scan(corridor, pose, NOISE, rng), MATCH)
        registered = register(map, scan, guess, guess, np.linalg.inv(prior), MATCH.reach)
        claims.append(np.sqrt(np.linalg.inv(registered.information)[0, 0]))
        assert abs(registered.pose[0] - guess[0]) < 4 * claims[-1]
        assert abs(registered.pose[1]) < 0.03
    assert np.median(claims) > 0.06


def corridor_with_niches(rng):
    """60 m long and 2.4 m wide, with fourteen niches 0.2 m deep on either side, anywhere."""
    sides = []
    for y, back in ((1.2, 1.4), (-1.2, -1.4)):
        niches = np.sort(rng.uniform(-29, 29, 28)).reshape(-1, 2)
        wall = [[(a, y), (a, back), (b, back), (b, y)] for a, b in niches]
        corners = np.concatenate([[(-30, y)], *wall, [(30, y)]])
        sides.append(np.stack([corners[:-1], corners[1:]], axis=1))
    return World(np.concatenate(sides))


@pytest.mark.parametrize("off", [0.0, 0.05, 1.0])
def test_a_scan_whose_niches_lie_elsewhere_does_not_say_where_it_is_along_a_corridor(off):
    """The guess is 1 m off where it may be 0.3 m: some niches meet others. 0.63 had been sure of a wrong place."""
    claims = []
    for k in range(60):
        rng = np.random.default_rng(k)
        corridor, guess = corridor_with_niches(rng), np.array([0.5, 0.0, 0.0])
        pose = np.array([rng.uniform(-10, 10), rng.uniform(-0.3, 0.3), 0.0])
        map = map_of([sick_scan(corridor, pose, NOISE, rng)])
        there = compose(pose, guess + np.array([off, 0.0, 0.0]))
        scan = patches(sick_scan(corridor, there, NOISE, rng), MATCH)
        prior = np.linalg.inv(np.diag([0.3, 0.05, 0.02]) ** 2)
        registered = register(map, scan, guess, guess, prior, MATCH.reach)
        claims.append(np.sqrt(np.linalg.inv(registered.information)[0, 0]))
    share = np.mean(np.array(claims) < 0.1)
    assert share > 0.7 if off < 0.1 else share < 0.4


def test_what_little_is_known_across_a_way_says_where_a_scan_lies_unless_the_guess_leaves_it_open():
    """A wall has been put up 6 m ahead, where only a metre of it had stood: most of what is seen ahead is new."""
    rng, guess = np.random.default_rng(6), np.array([0.03, 0.0, 0.0])
    near, far = ([[x, -4], [x, 4]] for x in (6.0, 8.0))
    sides = [[[-20, y], [20, y]] for y in (4.0, -4.0)]
    before, now = (World(np.array([*sides, *walls], float)) for walls in ([[[6, -4], [6, -3]], far], [near]))
    map = map_of([full_scan(before, np.zeros(3), NOISE, rng)])
    scan = patches(full_scan(now, guess, NOISE, rng), MATCH)
    claims = []
    for sigma in (0.03, 0.3):
        prior = np.linalg.inv(np.diag([sigma, 0.05, 0.02]) ** 2)
        registered = register(map, scan, guess, guess, prior, MATCH.reach)
        claims.append(np.sqrt(np.linalg.inv(registered.information)[0, 0]) / sigma)
    assert claims[0] < 0.9
    assert claims[1] == pytest.approx(1.0, rel=1e-3)


def test_the_gradient_is_that_of_the_weighted_squares():
    """Against finite differences, with the pairs and weights held: distances small enough not to change them."""
    rng = np.random.default_rng(5)
    pose = random_pose(ROOM, rng)
    map = map_of([full_scan(ROOM, pose, NOISE, rng)])
    scan = patches(full_scan(ROOM, pose, NOISE, rng), MATCH)
    x, H, B, g = np.array([0.004, -0.003, 0.002]), np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    linearised(map, scan, x, MATCH.reach, H, B, g, np.empty((2, 2, 2)))
    places, turned = act(x, scan.means), act(x * [0, 0, 1], scan.normals)
    pairs = np.array([nearest(map, *p, *n, MATCH.reach, 0.8) for p, n in zip(places, turned, strict=True)])
    on, k = pairs >= 0, pairs[pairs >= 0]

    def distances(x):
        return ((act(x, scan.means[on]) - map.means[k]) * map.normals[k]).sum(1)

    r = distances(x)
    weights = 1 / (scan.variances[on] + map.variances[k] + r**2 / 4)
    J = np.stack([(distances(x + d) - distances(x - d)) / 2e-6 for d in 1e-6 * np.eye(3)], -1)
    np.testing.assert_allclose(g, J.T @ (weights * r), rtol=1e-5, atol=1e-4)
    np.testing.assert_allclose(H, (J * weights[:, None]).T @ J, rtol=1e-5)


def test_the_search_finds_the_best_pose_of_its_window_and_the_best_one_besides():
    """Against all poses of the window, scored one by one with nearest neighbours."""
    rng = np.random.default_rng(3)
    settings = MatchSettings(cell=0.1, blur=0.15)
    pose, step = np.array([4.5, 4.0, 0.4]), np.array([0.5, -0.3, 0.2])
    reference = sick_scan(ROOM, pose, NOISE, rng).xy
    points = sick_scan(ROOM, compose(pose, step), NOISE, rng).xy
    guess, sigma = step + np.array([0.21, -0.33, 0.11]), np.array([0.2, 0.2, 0.1])
    found = search(reference, points, guess, sigma, settings)
    best = max(
        _score(reference, points, guess + np.array([dx, dy, 0]), turn, guess, sigma, settings)
        for dx in 0.1 * np.arange(-6, 7)
        for dy in 0.1 * np.arange(-6, 7)
        for turn in found[2] + (guess[2] - found[2]) * np.arange(-3, 4) / 3
    )
    assert _score(reference, points, found, found[2], guess, sigma, settings) >= best - 1e-3

    def besides(others):
        return candidates(reference, points, guess, 5 * sigma, settings, others)

    rest = list(islice(besides(found[None]), 4))
    for k, other in enumerate(rest):
        before = np.array([found, *rest[:k]])
        away = relative(before, other)
        assert ((np.hypot(*away[:, :2].T) > 0.4) | (abs(away[:, 2]) > 0.24)).all()
        assert other == pytest.approx(next(besides(before)))  # as if looked for alone


FAR = np.array([3.4, 0.0])


def two_places():
    """What `search` takes: 30 points fit at FAR, which costs 4; 23 at the guess, and the others there are not far."""
    points = np.random.default_rng(5).uniform(-6, 6, (30, 2))
    beside = np.where(np.arange(30)[:, None] < 23, 0.0, 0.35)
    reference, sigma = np.vstack([points + FAR, points + beside]), np.array([1.2, 1.2, 0.02])
    return reference, points, np.zeros(3), sigma, MatchSettings(cell=0.1, blur=0.1, max_shift=3.6)


def test_a_place_far_from_the_guess_wins_if_more_fits_there_than_the_way_costs():
    """Beside the guess more looks promising."""
    np.testing.assert_allclose(search(*two_places()), [*FAR, 0.0], atol=0.06)


def test_places_end_where_too_little_is_left_that_fits():
    """At most 26 of 30, as the way costs 4; where no point was copied to, few fit by chance."""
    found = list(islice(candidates(*two_places(), least=0.4), 5))
    np.testing.assert_allclose(found, [[*FAR, 0.0], [0.0, 0.0, 0.0]], atol=0.06)
    assert not list(candidates(*two_places(), least=0.9))


def test_surfels_are_the_weighted_means_of_the_patches_in_their_cells():
    rng = np.random.default_rng(6)
    seen = joined([patches(full_scan(ROOM, random_pose(ROOM, rng), NOISE, rng), MATCH) for _ in range(5)])
    map, number = surfels(seen, MATCH.patch, MATCH.reach), cells(seen.means, seen.normals, MATCH.patch, 0.1)
    assert len(map.means) == len(np.unique(number)) < len(number)
    for k in np.unique(number):
        of_cell = [column[number == k] for column in seen]
        means, normals, variances, tilts, counts = of_cell
        weights = 1 / variances
        mean, normal = (np.average(column, axis=0, weights=weights) for column in (means, normals))
        found = int(np.argmin(np.hypot(*(map.means - mean).T)))
        np.testing.assert_allclose(map.means[found], mean, atol=1e-9)
        np.testing.assert_allclose(map.normals[found], normal / np.hypot(*normal), atol=1e-9)
        np.testing.assert_allclose(map.variances[found], 1 / weights.sum())
        np.testing.assert_allclose(map.tilts[found], np.average(tilts, weights=weights) / len(tilts))
        assert map.near[found] == (counts > 0).any()
    assert all(
        ((map.means[map.first[i, j] : map.first[i, j + 1]] - map.low) // map.cell == [i, j]).all()
        for i in range(map.first.shape[0])
        for j in range(map.first.shape[1] - 1)
    )


@pytest.mark.parametrize("turn", [0.0, np.pi / 2])
def test_a_search_looks_as_far_to_one_side_as_to_the_other(turn):
    """What is seen lies 11 m ahead, and the guess 7 m behind."""
    seen = np.stack([np.linspace(10, 12, 60), np.linspace(-2, 2, 60) ** 2], -1)
    ahead = rotate(turn, np.array([1.0, 0.0]))
    sigma = np.array([*np.abs(rotate(turn, np.array([2.5, 0.1]))), 0.02])
    found = search(rotate(turn, seen) + 7 * ahead, rotate(turn, seen), np.zeros(3), sigma, MatchSettings())
    assert np.abs(found - [*(7 * ahead), 0.0]).max() < 0.1


def test_in_a_hall_whose_walls_are_all_far_away_a_search_looks_at_them():
    """50 by 40 m, with nothing within the horizon."""
    along, across = np.linspace(-25, 25, 200), np.linspace(-20, 20, 160)
    walls = [np.stack([along, np.full(200, y)], -1) for y in (-20, 20)]
    walls += [np.stack([np.full(160, x), across], -1) for x in (-25, 25)]
    hall, pose = np.concatenate(walls), np.array([2.0, -1.5, 0.2])
    found = search(hall, act_inverse(pose, hall), np.zeros(3), np.array([1.5, 1.5, 0.15]), MatchSettings())
    assert np.abs(pose_difference(found, pose)).max() < 0.15


def _score(reference, points, pose, turn, guess, sigma, settings):
    """Score of a pose as `search` defines it: Gaussians at the centres of cells, less the guess's penalty."""
    c, s = np.cos(turn), np.sin(turn)
    low = reference.min(axis=0) - (3 * settings.blur + 8 * settings.cell)
    cells = np.floor((points @ np.array([[c, s], [-s, c]]) + pose[:2] - low) / settings.cell + 1e-9)
    centres = low + (cells + 0.5) * settings.cell
    distance, _ = cKDTree(reference).query(centres)
    scores = np.where(distance < 3 * settings.blur, np.exp(-(distance**2) / (2 * settings.blur**2)), 0)
    offset = (np.array([*pose[:2], turn]) - guess) / sigma
    return scores.sum() - (offset**2).sum() / 2


@pytest.mark.parametrize("ranges", [np.full(180, np.nan), np.where(np.arange(180) == 3, 2.0, np.nan)])
def test_a_scan_without_surfaces_has_no_patches_and_stays_at_the_guess(ranges):
    rng = np.random.default_rng(6)
    map = map_of([sick_scan(ROOM, random_pose(ROOM, rng), NOISE, rng)])
    seen = patches(Scan(ranges, np.deg2rad(np.arange(-90.0, 90))), MATCH)
    guess = np.array([0.1, 0.2, 0.3])
    registered = register(map, seen, guess, guess, np.eye(3), MATCH.reach)
    assert len(seen.means) == 0
    assert registered.inliers == 0
    np.testing.assert_allclose(registered.pose, guess, atol=1e-9)
    np.testing.assert_allclose(registered.information, np.eye(3), atol=1e-9)
