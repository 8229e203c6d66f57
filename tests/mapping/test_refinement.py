"""The adjustment of all keyframes, against dense algebra written otherwise, and its claims against known truth."""

from dataclasses import replace

import numpy as np
import pytest
from mapping_scenes import NOISE, full_scan
from scipy.stats import chi2

from lidarcore.geometry import act, compose, pose_difference, relative
from lidarcore.mapping import MatchSettings
from lidarcore.mapping.graph.adjustment import _VAGUE, Surfaces, normal_equations, speeds_left
from lidarcore.mapping.graph.adjustment_cells import Groups
from lidarcore.mapping.graph.cell_lines import Noise, Observations
from lidarcore.mapping.graph.equations import Step
from lidarcore.mapping.graph.refinement import _observations, refine
from lidarcore.mapping.graph.surface_noise import UNMEASURED, measured
from lidarcore.mapping.matching.distortion import seen_since
from lidarcore.mapping.matching.patches import patches
from lidarcore.mapping.motion.sweep import without
from lidarcore.simulation import World, furnished_room
from lidarcore.simulation.paths import wandering
from lidarcore.simulation.rooms import rectangular_room

MATCH = MatchSettings(noise=NOISE, unevenness=0)
VAGUE = np.diag([0.1, 0.1, 0.05]) ** 2


def seen_from(world: World, poses, rng):
    return [patches(full_scan(world, pose, NOISE, rng), MATCH) for pose in poses]


def test_the_normal_equations_are_those_of_poses_and_lines_with_the_lines_eliminated():
    """Three keyframes see one wall in one cell: the dense problem has 9 + 9 + 2 unknowns, with the speeds of each.

    Its normal is that of the line through all patches, each as two points 3 cm from its middle, and turns with the
    first keyframe. What is left of the speeds is what each keyframe says, its own pose unknown, but for something that
    makes even one wall tell all.
    """
    rng = np.random.default_rng(1)
    poses = np.array([[0, 0, 0.1], [0.1, 0.2, -0.2], [-0.1, 0.1, 0.3]])
    keyframes = np.repeat(np.arange(3), 3)
    t = rng.uniform(0.05, 0.45, 9)
    world = np.stack([t, 5.2 + rng.normal(0, 0.001, 9)], -1)
    means = np.array(
        [act(compose(np.zeros(3), _inverse(poses[k])), p) for k, p in zip(keyframes, world, strict=True)]
    )
    normals = np.array([act(np.array([0, 0, -poses[k, 2]]), np.array([0.0, -1.0])) for k in keyframes])
    variances = rng.uniform(0.5, 2, 9) * 1e-4
    since = rng.uniform(-0.05, 0.05, 9)
    seen = Observations(keyframes, means, normals, variances, np.ones(9, bool), since)
    of_it = Surfaces(seen, np.zeros(len(poses), np.int64), 0.5), poses, Noise(2.0, 0.003**2)
    (sums, groups), left = normal_equations(*of_it), speeds_left(*of_it)
    assert len(groups.squares) == 3  # in one cell
    weights = 1 / (2 * variances + 3 * 0.003**2)
    middle = world.mean(axis=0)
    ends = np.concatenate([world + np.array([0.03, 0]), world - np.array([0.03, 0])]) - middle
    slope = np.polyfit(*ends.T, 1, w=np.tile(variances**-0.5, 2))[0]
    normal = np.array([slope, -1]) / np.hypot(slope, 1)

    def residuals(x):
        at, speeds = x[:9].reshape(3, 3), x[9:18].reshape(3, 3)
        then = compose(at[keyframes], since[:, None] * speeds[keyframes])
        placed = np.array([act(pose, m) for pose, m in zip(then, means, strict=True)])
        r = (placed - middle) @ normal - x[18] - x[19] * t0
        return np.append(np.sqrt(weights) * r, x[19] + x[2] - poses[0, 2])

    t0 = (world - middle) @ [-normal[1], normal[0]]
    x0 = np.append(poses.ravel(), np.zeros(11))
    J = np.stack([(residuals(x0 + d) - residuals(x0 - d)) / 2e-6 for d in 1e-6 * np.eye(20)], -1)
    H, g = J.T @ J, J.T @ residuals(x0)
    schur = H[:18, :18] - H[:18, 18:] @ np.linalg.solve(H[18:, 18:], H[18:, :18])
    rest = g[:18] - H[:18, 18:] @ np.linalg.solve(H[18:, 18:], g[18:])
    np.testing.assert_allclose(sums.information().toarray(), schur[:9, :9], rtol=1e-5, atol=1e-2)
    np.testing.assert_allclose(sums.gradient, rest[:9], rtol=1e-5, atol=1e-3)
    for k in range(3):
        of_k = np.r_[3 * k : 3 * k + 3, 9 + 3 * k : 12 + 3 * k]
        P = np.linalg.inv(schur[np.ix_(of_k, of_k)] + np.diag(_VAGUE))
        np.testing.assert_allclose(left[k, 0], -(P @ rest[of_k])[3:], rtol=1e-3, atol=1e-6)
        np.testing.assert_allclose(left[k, 1], np.diag(P)[3:], rtol=1e-3)


def test_what_keyframes_see_of_each_other_tells_nothing_of_how_the_map_lies():
    """Of moving and turning all poses as one: each cell had told how the map is turned, to 1 rad; hundreds, to .05."""
    poses = np.array([[0.3 * k, 0.1, 0.1 * k] for k in range(8)])
    scans = seen_from(
        furnished_room(), relative(np.array([-3.0, -2.0, 0.0]), poses), np.random.default_rng(5)
    )
    seen = _observations(scans, None, 0.0)
    equations, _ = normal_equations(Surfaces(seen, np.zeros(8, np.int64), 0.5), poses, Noise(1.0, 1e-6))
    H, as_one = equations.information(), np.zeros((8, 3, 3))
    as_one[:] = np.eye(3)
    as_one[:, :2, 2] = poses[:, :2] @ [[0, 1], [-1, 0]]
    as_one = as_one.reshape(24, 3)
    assert equations.lines.shape[1] > 2 * 20  # two unknowns for each cell's line
    assert H.diagonal().min() > 1e4
    np.testing.assert_allclose(as_one.T @ H @ as_one, 0.0, atol=1e-3)
    np.testing.assert_allclose(as_one.T @ equations.gradient, 0.0, atol=1e-3)


def test_a_wall_that_bends_has_the_directions_of_its_parts():
    """Two keyframes see half a metre straight on and half a metre that rises: as if these were far from each other."""
    rng, along = np.random.default_rng(2), np.linspace(0.05, 0.45, 9)
    parts = []
    for begin, slope in ((0.0, 0.0), (0.5, 0.3)):
        places = np.stack([begin + along, 5.2 + slope * along], -1)
        noise = rng.normal(0, 0.001, (2, len(along)))
        seen = np.concatenate([places + np.array([0, 1]) * off[:, None] for off in noise])
        normal = np.array([slope, -1]) / np.hypot(slope, 1)
        parts.append((np.repeat([0, 1], len(along)), seen, np.tile(normal, (2 * len(along), 1))))

    def information(*parts):
        keyframes, means, normals = (np.concatenate(column) for column in zip(*parts, strict=True))
        n = len(means)
        seen = Observations(keyframes, means, normals, np.full(n, 1e-6), np.ones(n, bool), np.zeros(n))
        surfaces = Surfaces(seen, np.zeros(2, np.int64), 0.5)
        found, _ = normal_equations(surfaces, np.zeros((2, 3)), Noise(1.0, 0.0))
        return found.information().toarray()

    apart = information(parts[0]) + information(parts[1])
    together = information(*parts)
    largest = np.sqrt(np.outer(np.diag(apart), np.diag(apart)))
    np.testing.assert_allclose(together / largest, apart / largest, atol=0.01)


@pytest.mark.parametrize("off", [-0.4, 0.4])
def test_steps_count_the_same_wherever_the_poses_are_to_begin_with(off):
    """What a third keyframe saw is of another island: two steps alone lead there, a metre apart and equally vague."""
    truth = np.array([[0.0, 0.0, 0.0], [0.4, 0.1, 0.1], [1.4, 0.1, 0.1]])
    scans = seen_from(rectangular_room(6, 4), truth, np.random.default_rng(3))
    between = relative(truth[1], truth[2])
    aside = np.array([0.5, 0.0, 0.0])
    steps = [
        Step(0, 1, relative(truth[0], truth[1]), VAGUE),
        Step(1, 2, between - aside, VAGUE),
        Step(1, 2, between + aside, VAGUE),
    ]
    begin = np.array([truth[0], truth[1], compose(truth[1], between + np.array([off, 0, 0]))])
    found = refine(scans, begin, steps, 0.5, islands=np.array([0, 0, 1])).poses
    np.testing.assert_allclose(relative(found[1], found[2]), between, atol=1e-3)


def test_surfaces_tell_how_much_faster_a_sensor_moved_than_was_taken_out_of_a_scan():
    """100 maps of six scans in a room, of which one is distorted by a motion that nobody took out.

    The mean of 300 squares: a claim too large or too small by a seventh is 3 standard deviations away.
    """
    rng, world, squares = np.random.default_rng(4), furnished_room(), []
    poses = wandering(np.linspace(0, 4, 6))
    times = np.linspace(0, 0.1, 920, endpoint=False)
    for k in range(100):
        number, moved = k % len(poses), rng.normal(0, [0.2, 0.2, 0.1])
        scans = [replace(full_scan(world, pose, NOISE, rng), beam_times=times) for pose in poses]
        scans[number] = without(scans[number], -moved)
        seen = [patches(scan, MATCH) for scan in scans]
        since = [seen_since(scan, one) for scan, one in zip(scans, seen, strict=True)]
        steps = [Step(k, k + 1, relative(poses[k], poses[k + 1]), VAGUE) for k in range(len(poses) - 1)]
        left, variances = refine(seen, relative(poses[0], poses), steps, 0.5, since=since).speeds[number]
        squares.append((left - moved) ** 2 / variances)
    print(np.mean(squares, axis=0), np.sqrt(variances))
    assert (variances < [0.1, 0.1, 0.05]).all()  # so that the motion is seen
    assert 0.75 < np.mean(squares) < 1.33


def _inverse(pose):
    return relative(pose, np.zeros(3))


def runs(world, poses, number, first=0):
    """Normalised errors (number, 3 pairs) of relative poses from refined maps of a way, begun a little off."""
    nees = []
    for seed in range(first, first + number):
        rng = np.random.default_rng(seed)
        scans = seen_from(world, poses, rng)
        driven = relative(poses[:-1], poses[1:]) + rng.multivariate_normal(
            np.zeros(3), VAGUE / 25, len(poses) - 1
        )
        steps = [Step(k, k + 1, z, VAGUE / 25) for k, z in enumerate(driven)]
        start = relative(poses[0], poses) + rng.normal(0, [0.02, 0.02, 0.005], (len(poses), 3))
        start[0] = 0
        refined = refine(scans, start, steps, 0.5)
        row = []
        for i, j in ((0, 1), (0, len(poses) - 1), (len(poses) // 2, len(poses) - 1)):
            found = refined.relative(i, j)
            off = pose_difference(found.pose, relative(poses[i], poses[j]))
            row.append(off @ np.linalg.solve(found.covariance, off))
        nees.append(row)
    return np.array(nees)


ROOM_WAY = np.array([[3 + 0.35 * k, 3 + 0.1 * k, 0.2 * k] for k in range(8)])
HALL_WAY = np.array([[-3.0 + 0.8 * k, 0.3 * k, 0.1 * k] for k in range(8)])
CORRIDOR_WAY = np.array([[-1.5 + 0.4 * k, 0.05 * k, 0.02 * k] for k in range(8)])


@pytest.mark.parametrize(
    ("world", "poses"),
    [
        (furnished_room(), ROOM_WAY),
        (rectangular_room(20, 14), HALL_WAY),
        (rectangular_room(60, 2.4), CORRIDOR_WAY),
    ],
    ids=["room", "hall", "corridor"],
)
def test_relative_poses_are_as_far_off_as_they_claim(world, poses):
    """NEES of 40 runs: its mean lies where chi-square would in all but one of a million runs, give or take 15 %."""
    nees = runs(world, poses, 40)
    low, high = (chi2.ppf(p, 3 * len(nees)) / len(nees) for p in (5e-7, 1 - 5e-7))
    for column in nees.T:
        assert 0.85 * low < column.mean() < 1.15 * high


@pytest.mark.parametrize("seed", range(3))
def test_along_bare_walls_only_steps_say_how_far_it_went(seed):
    """Errors of the directions of single cells had passed for knowledge: it went astray, and claimed half."""
    rng = np.random.default_rng(seed)
    poses = np.array([[0.3 * k - 9, 0.0, 0.0] for k in range(60)])
    views = [full_scan(rectangular_room(60, 2.4), pose, NOISE, rng) for pose in poses]
    near = [replace(scan, ranges=np.where(scan.ranges < 6, scan.ranges, np.nan)) for scan in views]
    driven = relative(poses[:-1], poses[1:]) + rng.normal(0, [0.05, 0.002, 0.002], (len(poses) - 1, 3))
    steps = [Step(k, k + 1, z, np.diag([0.05, 0.002, 0.002]) ** 2) for k, z in enumerate(driven)]
    start = np.zeros((len(poses), 3))
    for k, z in enumerate(driven):
        start[k + 1] = compose(start[k], z)
    start[:, 1:] = 0.0
    found = refine([patches(scan, MATCH) for scan in near], start, steps, 0.5).relative(0, len(poses) - 1)
    told = 0.05 * np.sqrt(len(steps))
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(told, rel=0.1)
    assert found.pose[0] == pytest.approx(driven[:, 0].sum(), abs=0.5 * told)


def weighed(claimed, keyframes, rng):
    """Orthonormal directions (G, 3 K) in which poses move groups of these variances, each in units of its own."""
    return np.linalg.qr(rng.normal(size=(len(claimed), 3 * keyframes)) / np.sqrt(claimed)[:, None])[0]


def groups_left(claimed, true, Q, rng):
    """Groups of these variances, whose squares are what a fit of the poses leaves by what they claim."""
    noise = rng.normal(size=len(claimed)) * np.sqrt(true / claimed)
    squares = claimed * (noise - Q @ (Q.T @ noise)) ** 2
    return Groups(squares, claimed, np.ones(len(claimed)), np.ones(len(claimed)))


def test_noise_is_measured_by_the_surfaces_that_tell_the_poses():
    """A third of the groups scatters far less than it says, as where walls meet. By 3,000 others noise is known to 3 %,
    give or take six standard deviations 16 %; counted alike, all of them would make it less than .7.
    """
    rng = np.random.default_rng(7)
    claimed = np.concatenate([rng.uniform(1e-6, 1e-5, 3000), rng.uniform(3e-4, 2e-3, 1500)])
    true = np.where(claimed < 1e-4, claimed, 0.05 * claimed)
    left = rng.uniform(0.5, 1.0, len(claimed))
    squares, *_ = groups_left(claimed, true, weighed(claimed, 60, rng), rng)
    scale, unevenness = measured(Groups(left * squares, claimed, left, np.ones(len(claimed))), 60)
    print(scale)
    assert 0.84 < scale < 1.16
    assert unevenness < 1e-6


def test_what_poses_take_up_is_noise_too():
    """180 unknowns take up nearly half of what 400 precise groups scatter, and hardly any of 2,000 vague ones; and of
    all squares, a fortieth is in those that are more than nine times as expected, which are left out.

    100 maps of 220 free precise groups each: noise is known to 0.7 %, give or take three standard deviations 2 %. As if
    all groups gave way alike, it was .58.
    """
    rng = np.random.default_rng(11)
    claimed = np.concatenate([np.full(400, 1e-6), np.full(2000, 1e-3)])
    Q = weighed(claimed, 60, rng)
    found = np.array([measured(groups_left(claimed, claimed, Q, rng), 60) for _ in range(100)])
    times = found[:, 0] + found[:, 1] / claimed[0]
    print(np.mean(times), np.std(times))
    assert 0.98 < np.mean(times) < 1.02


def test_unevenness_that_patches_assume_does_not_count_twice():
    """It is measured here: what a match assumed of it changes nothing."""
    poses = np.array([[0.3 * k, 0.1, 0.05 * k] for k in range(5)])
    assumed = 0.005
    found = []
    for unevenness in (0.0, assumed):
        rng, match = np.random.default_rng(3), MatchSettings(noise=NOISE, unevenness=unevenness)
        scans = [patches(full_scan(furnished_room(), pose, NOISE, rng), match) for pose in poses]
        start = relative(poses[0], poses)
        steps = [Step(k, k + 1, relative(poses[k], poses[k + 1]), VAGUE) for k in range(4)]
        found.append(refine(scans, start, steps, 0.5, assumed=unevenness))
    bare, uneven = found
    np.testing.assert_allclose(uneven.poses, bare.poses, atol=1e-9)
    np.testing.assert_allclose(uneven.covariances()[4], bare.covariances()[4], rtol=1e-6)
    assert uneven.noise == pytest.approx(bare.noise)


def test_noise_that_no_surface_tells_is_taken_to_be_usual():
    """As of two keyframes that saw nothing in common; of no rows at all, scipy's least squares returns anything."""
    assert measured(Groups(*np.empty((4, 0))), 2) == UNMEASURED
    unsure = Groups(np.ones(5), np.full(5, 1e-6), np.ones(5), np.zeros(5))
    assert measured(unsure, 2) == UNMEASURED


def test_noise_is_measured_alike_wherever_the_adjustment_begins():
    """From poses that are nearly right, where the first step is small as long as nobody knows the noise, and from ones
    that are centimetres off.
    """
    rng = np.random.default_rng(8)
    poses = np.array([[0.02 * k, 0.1 * np.sin(0.1 * k), 0.03 * k] for k in range(120)])
    scans = seen_from(furnished_room(), poses, rng)
    true = relative(poses[0], poses)
    steps = [Step(k, k + 1, relative(poses[k], poses[k + 1]), VAGUE) for k in range(119)]
    first = refine(scans, true, steps, 0.5)
    found = [first]
    for away in (0.0003, 0.001, 0.003, 0.02):
        off = away * rng.normal(size=true.shape) * [1, 1, 0.3]
        found.append(refine(scans, first.poses + np.where(np.arange(120)[:, None] > 0, off, 0), steps, 0.5))
    scale, unevenness = np.array([one.noise for one in found]).T
    print(scale, np.sqrt(unevenness))
    np.testing.assert_allclose(scale, np.mean(scale), rtol=0.02)
    np.testing.assert_allclose(np.sqrt(unevenness), np.sqrt(np.mean(unevenness)), atol=0.0001)
