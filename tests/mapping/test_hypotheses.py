"""Where a node may be on an earlier pass: its true place, however far from there the graph expects it, and rivals."""

import numpy as np
import pytest

from lidarcore.geometry import act, chi_square_gate, compose, pose_difference, relative, squared_mahalanobis
from lidarcore.mapping import LoopSettings, PoseGraph
from lidarcore.mapping.loops.hypotheses import Hypotheses
from lidarcore.mapping.loops.keyframes import Keyframe
from lidarcore.mapping.loops.passes import Passes
from lidarcore.mapping.matching.patches import patches
from lidarcore.mapping.matching.sight import sight
from lidarcore.simulation import World
from tests.mapping.mapping_scenes import NOISE, SETTINGS, sick_scan

MATCH, LOOPS = SETTINGS.front.match, LoopSettings()
PITCH = 2.4  # m between doors, all of them alike
HERE = np.array([24.0, 0.1, 0.0])  # where the newest node is
BEFORE = 4


def side(y, deep):
    """A wall along a corridor, with a recess of 0.9 m for each door."""
    points = [[0.0, y]]
    for x in np.arange(1.0, 46.0, PITCH):
        points += [[x, y], [x, y + deep], [x + 0.9, y + deep], [x + 0.9, y]]
    points.append([48.0, y])
    return np.stack([points[:-1], points[1:]], axis=1)


def box(x, y, side=0.5):
    corners = np.array([[x, y], [x + side, y], [x + side, y + side], [x, y + side], [x, y]])
    return np.stack([corners[:-1], corners[1:]], axis=1)


CORRIDOR = World(np.concatenate([side(-1.2, -0.25), side(1.2, 0.25)]))
FURNISHED = World(np.concatenate([CORRIDOR.walls, box(22.6, 0.7), box(25.4, -1.2), box(27.0, 0.7)]))


def newest_on_first(world, off, sigma=2.5, vague=None):
    """A pass along a corridor, and a few nodes of a second one that the graph has `off` m too far along.

    As far as the graph knows, that is uncertain by sigma m; and the step to the node `vague` by 0.9 m.
    """
    rng = np.random.default_rng(3)
    first = np.stack([np.arange(6.0, 42.0, 0.5), np.zeros(72), np.zeros(72)], -1)
    second = HERE + np.stack([np.arange(-BEFORE, 1) * 0.5, np.zeros(5), np.zeros(5)], -1)
    truth = np.concatenate([first, second])
    graph = PoseGraph(first[0])
    for k in range(1, len(truth)):
        step, tight = relative(truth[k - 1], truth[k]), np.diag([0.01, 0.01, 0.002]) ** 2
        if k == len(first):
            step, tight = step + np.array([off, 0.0, 0.0]), np.diag([sigma, 0.3, 0.03]) ** 2
        if k == vague:
            tight = np.diag([0.9, 0.2, 0.02]) ** 2
        graph.connect(k - 1, graph.add(compose(graph.poses[k - 1], step)), step, tight)
    keyframes = {}
    for k, pose in enumerate(truth):
        scan = sick_scan(world, pose, NOISE, rng)
        keyframes[k] = Keyframe(k, scan, patches(scan, MATCH), sight(scan), np.zeros((3, 3)))
    return truth, graph, keyframes


def places(world, off):
    """Metres along the corridor by which each place that is found is off; the best one first."""
    truth, graph, keyframes = newest_on_first(world, off)
    passes, k = Passes(graph, keyframes, LOOPS, MATCH), len(truth) - 1
    hypotheses = Hypotheses(graph, keyframes, passes, LOOPS, MATCH)
    ((i, P),) = passes.worth_a_match(k)
    found = hypotheses.at(i, k, P, passes.seen(k, np.arange(k - BEFORE, k + 1)))
    found.sort(key=lambda loop: -loop.quality)
    return np.array([(compose(truth[loop.i], loop.pose) - truth[k])[0] for loop in found])


@pytest.mark.parametrize("off", [-4.9, 0.0, 4.9])
def test_the_true_place_is_found_wherever_the_graph_expects_it(off):
    assert np.abs(places(FURNISHED, off)).min() < 0.1


@pytest.mark.parametrize(("sigma", "count"), [(MATCH.max_shift / 2, 1), (2 * MATCH.max_shift, 0)])
def test_what_is_vaguer_than_a_search_looks_far_is_not_searched(sigma, count):
    """It would be found by chance, and such searches took most of the time where the pose was lost often."""
    truth, graph, keyframes = newest_on_first(FURNISHED, 0.0, sigma)
    assert len(Passes(graph, keyframes, LOOPS, MATCH).worth_a_match(len(truth) - 1)) == count


@pytest.mark.parametrize("x", np.arange(19.0, 25.0, 0.5))
def test_a_node_is_sought_as_vaguely_as_it_is_known_from_where_it_is_sought(x):
    """In the middle of the pass, at 21 m, a step is vague. What lies beyond it is known worse than what is nearest."""
    _, graph, keyframes = newest_on_first(FURNISHED, 0.0, 0.3, vague=31)
    k = len(graph) - 1
    poses = graph.poses.copy()
    poses[72:, 0] += x - HERE[0]
    graph.move(poses)
    sought = Passes(graph, keyframes, LOOPS, MATCH).worth_a_match(k)
    assert sought
    for i, P in sought:
        np.testing.assert_allclose(P, graph.relative(i, k).covariance)


def test_what_was_seen_just_before_is_a_place_too():
    """An island that is joined to the last keyframes before it: they are no farther back than one pass of loops."""
    truth, graph, keyframes = newest_on_first(FURNISHED, 0.0)
    passes, k = Passes(graph, keyframes, LOOPS, MATCH), len(truth) - 1
    assert passes.around(k - 3, k, 0.0).tolist() == [k - 7, k - 6, k - 5, k - 4, k - 3]
    assert passes.around(40, k, 0.0).tolist() == list(range(36, 45))
    assert passes.around(40, k, 4.2).tolist() == list(range(32, 49))
    hypotheses = Hypotheses(graph, keyframes, passes, LOOPS, MATCH)
    seen = passes.seen(k, np.arange(k - 2, k + 1))
    (loop,) = hypotheses.at(k - 3, k, np.diag([0.05, 0.05, 0.02]) ** 2, seen)
    assert np.abs(loop.pose - relative(truth[k - 3], truth[k])).max() < 0.05


def newest_after_a_bend(turned):
    """How far (3,) the loop of a node is off whose last step is off by so many rad, and the covariance it claims."""
    last = 76
    truth, graph, keyframes = newest_on_first(FURNISHED, 0.0, vague=last)
    poses = graph.poses.copy()
    poses[last, 2] += turned
    graph.move(poses)
    passes = Passes(graph, keyframes, LOOPS, MATCH)
    hypotheses = Hypotheses(graph, keyframes, passes, LOOPS, MATCH)
    ((i, P),) = passes.worth_a_match(last)
    (loop,) = hypotheses.at(i, last, P, passes.seen(last, np.arange(last - BEFORE, last + 1)))
    return pose_difference(loop.pose, relative(truth[loop.i], truth[last])), loop.covariance


def test_a_loop_says_where_the_newest_scan_was_taken_however_it_is_tied_to_those_before():
    """Its step is off by 30 mrad, known to 20: what the last five scans saw, put together so, is bent."""
    (left, P), (right, Q) = (newest_after_a_bend(turned) for turned in (0.03, -0.03))
    assert squared_mahalanobis(left, P) < chi_square_gate(0.99, 3)
    assert squared_mahalanobis(right, Q) < chi_square_gate(0.99, 3)
    assert abs(left[2] - right[2]) < 0.06 / 30


def test_a_loop_is_as_unsure_as_the_sensors_are_of_where_their_scans_stand():
    """Drawn: both sensors are off from where their scans stand, by how these moved in a revolution."""
    truth, graph, keyframes = newest_on_first(FURNISHED, 0.0)
    i, k, rng = len(truth) - 4, len(truth) - 1, np.random.default_rng(5)
    sweeps = {i: np.diag([0.03, 0.01, 0.02]) ** 2, k: np.diag([0.01, 0.04, 0.03]) ** 2}

    def loop(of_scans):
        passes = Passes(graph, of_scans, LOOPS, MATCH)
        seen = passes.seen(k, np.arange(k - 2, k + 1))
        hypotheses = Hypotheses(graph, of_scans, passes, LOOPS, MATCH)
        return hypotheses.at(i, k, np.diag([0.05, 0.05, 0.02]) ** 2, seen)[0]

    still = loop(keyframes)
    swept = loop(keyframes | {node: keyframes[node]._replace(sweep=sweeps[node]) for node in sweeps})
    off_i, off_k = (rng.multivariate_normal(np.zeros(3), sweeps[node], 20_000) for node in (i, k))
    drawn = relative(off_i, compose(still.pose, off_k))
    np.testing.assert_array_equal(swept.pose, still.pose)
    grown = swept.covariance - still.covariance
    np.testing.assert_allclose(grown, np.cov(drawn.T), atol=0.05 * np.diag(np.cov(drawn.T)).max())


@pytest.mark.parametrize("off", [-4.9, 4.9])
def test_doors_that_are_alike_are_rivals_of_each_other(off):
    """Nothing tells one door from the next, so that none may be believed alone; all of them lie a door apart."""
    found = places(CORRIDOR, off)
    assert len(found) >= 3
    np.testing.assert_allclose(found / PITCH, np.round(found / PITCH), atol=0.05)
    assert len(set(np.round(found / PITCH))) == len(found)


def test_what_nodes_saw_together_is_what_each_saw_seen_from_one_of_them():
    """But for what says how walls lie, and nothing of where they are seen."""
    truth, graph, keyframes = newest_on_first(FURNISHED, 0.0)
    nodes = np.array([30, 31, 35])
    seen = Passes(graph, keyframes, LOOPS, MATCH).seen(32, nodes)
    assert any((keyframes[node].patches.counts == 0).any() for node in nodes)
    near = [keyframes[node].patches.near for node in nodes]
    in_map = [act(truth[node], one.means) for node, one in zip(nodes, near, strict=True)]
    np.testing.assert_allclose(act(truth[32], seen.means), np.concatenate(in_map), atol=1e-9)
    np.testing.assert_array_equal(seen.counts, np.concatenate([one.counts for one in near]))


@pytest.mark.parametrize("found", [[5, 6, 7, 8, 9, 12, 13, 14], [18, 19, 20], [40]])
def test_a_pass_ends_where_the_way_leads_away_for_more_than_two_nodes(found):
    near, graph = {5, 6, 7, 8, 9, 12, 13, 14, 18, 19, 20, 40}, PoseGraph()
    for node in range(1, 61):
        graph.add([0.0 if node in near else 50.0, 0.0, 0.0])
    passes = Passes(graph, {}, LoopSettings(before=0), MATCH)
    for i in found:
        assert passes.around(i, 60, 1.0).tolist() == found
