"""What is mapped after the sensor may have been carried elsewhere: a simulated building, and a real one."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from mapping_scenes import BUILDING, NOISE, full_scan, way

from lidarcore import open_recording
from lidarcore.evaluation.maps.study import prepared, study
from lidarcore.geometry import UncertainPose, compose, pose_difference
from lidarcore.mapping import MapperSettings, MatchSettings, WholeScans
from lidarcore.mapping.graph.pose_graph import PoseGraph
from lidarcore.mapping.loops.islands import Found, Islands, moved
from lidarcore.mapping.loops.keyframes import Keyframe
from lidarcore.mapping.matching.patches import patches
from lidarcore.mapping.matching.sight import sight
from lidarcore.simulation import World

VAGUE = np.diag([1.0, 1.0, 3.0]) ** 2
WRONG = np.array([4.0, -3.0, 2.8])  # where the graph takes the island's own frame to lie


def charted(graph, keyframes, world, poses, at):
    """Append what is seen at poses (K, 3) as nodes at other poses (K, 3)."""
    rng = np.random.default_rng(len(keyframes))
    for seen_from, pose in zip(poses, at, strict=True):
        scan = full_scan(world, seen_from, NOISE, rng)
        keyframes[len(keyframes)] = Keyframe(
            len(keyframes), scan, patches(scan, MatchSettings(noise=NOISE)), sight(scan), np.zeros((3, 3))
        )
        if len(keyframes) > 1:
            node = graph.add(pose)
            graph.connect(node - 1, node, [0.3, 0, 0], VAGUE)


@pytest.fixture
def around():
    """A way around the building, mapped, and its poses seen from the first."""
    poses = way(0.3, 1.0)
    graph, keyframes = PoseGraph(poses[0]), {}
    charted(graph, keyframes, BUILDING, poses, poses)
    return graph, keyframes, Islands(graph, keyframes), poses


def test_an_island_is_found_where_it_lies_however_wrong_the_graph_has_it(around):
    graph, keyframes, islands, poses = around
    back = poses[62:30:-2] + np.array([0, 0, np.pi])
    ground = len(graph)
    islands.begin(ground, ground - 1)
    found = None
    for pose in back:
        charted(graph, keyframes, BUILDING, pose[None], compose(WRONG, pose)[None])
        found = islands.find(len(graph) - 1)
        if found:
            break
    assert found is not None
    assert found.island == 0
    assert found.k - ground + 1 >= 2 * 6, "two views of six keyframes share none"
    assert np.abs(pose_difference(found.pose, back[found.k - ground])).max() < 0.06
    assert islands.numbers.tolist() == [0] * ground + [1] * (len(graph) - ground)

    after = moved(graph.poses, np.arange(ground, len(graph)), found)
    assert after[:ground] == pytest.approx(graph.poses[:ground])
    off = pose_difference(after[ground:], back[: len(graph) - ground])
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.3
    islands.join(found)
    assert not islands.numbers.any()
    assert islands.find(len(graph) - 1) is None


def test_an_island_in_another_building_is_found_nowhere(around):
    graph, keyframes, islands, poses = around
    elsewhere = World(BUILDING.walls * [0.7, 1.4] + [0, 20])
    there = poses[10:34] * [0.7, 1.4, 1] + [0, 20, 0]
    islands.begin(len(graph), len(graph) - 1)
    for pose in there:
        charted(graph, keyframes, elsewhere, pose[None], pose[None])
        assert islands.find(len(graph) - 1) is None


def test_what_is_known_on_an_island_does_not_drown_in_how_vaguely_dozens_of_islands_lie():
    """A robot that is carried elsewhere again and again: on each island two nodes are known to millimetres."""
    graph, keyframes = PoseGraph(), {}
    islands = Islands(graph, keyframes)
    step, known, carried = (
        np.array([0.5, 0.1, 0.2]),
        np.diag([1e-3, 1e-3, 5e-4]) ** 2,
        np.array([40, 30, 2.0]),
    )
    for _ in range(60):
        last = len(graph) - 1
        shore, tie = islands.shore(last, UncertainPose(carried, np.diag([1e3, 1e3, 7.0]) ** 2))
        node = graph.add(compose(graph.poses[shore], tie.pose))
        graph.connect(shore, node, *tie)
        islands.begin(node, shore)
        graph.connect(node, graph.add(compose(graph.poses[node], step)), step, known)
    graph.optimize()
    assert islands.numbers.max() == 60
    for node in range(1, len(graph), 2):
        assert graph.relative(node, node + 1).covariance == pytest.approx(known, rel=1e-3, abs=1e-12)


def test_an_island_hangs_on_the_node_that_the_island_before_it_hangs_on(around):
    graph, _, islands, _ = around
    ground, tie = len(graph) - 1, UncertainPose(np.array([2.0, 1.0, 0.5]), np.diag([0.3, 0.2, 0.6]) ** 2)
    shore, same = islands.shore(ground, tie)
    assert (shore, same.pose.tolist()) == (ground, tie.pose.tolist())
    assert same.covariance == pytest.approx(tie.covariance)

    first = graph.add(compose(graph.poses[ground], tie.pose))
    graph.connect(ground, first, *tie)
    islands.begin(first, ground)
    shore, both = islands.shore(first, tie)
    assert shore == ground
    expected = tie.compose(tie)
    assert both.pose == pytest.approx(expected.pose)
    assert both.covariance == pytest.approx(expected.covariance)
    islands.join(Found(first, 0, graph.poses[first]))
    assert islands.shore(first, tie)[0] == first


def test_how_an_island_is_turned_is_never_less_certain_than_any_heading(around):
    graph, _, islands, _ = around
    P = np.array([[1.0, 0, 2.0], [0, 1.0, 0], [2.0, 0, 40.0]])
    _, (_, covariance) = islands.shore(len(graph) - 1, UncertainPose(np.zeros(3), P))
    assert covariance[2, 2] == pytest.approx(np.pi**2 / 3)
    assert covariance[:2, :2] == pytest.approx(P[:2, :2])
    assert np.linalg.eigvalsh(covariance).min() > 0


@pytest.mark.long
@pytest.mark.real_data
def test_the_live_pose_is_lost_while_nobody_knows_how_an_island_lies(data):
    """Where odometry ends, in the ACES building, a scan after a break of 2.4 s fits in two places."""
    scans = list(open_recording(data / "carmen_radish_corrected" / "aces-corrected.log.gz"))
    driven = prepared(scans, "poor", 0)[0][:80]
    seen = driven[:67] + [replace(scan, odometry=None) for scan in driven[67:]]
    with closing(WholeScans()) as live:
        states = [live.step(live.deskewed(scan)).state for scan in seen]
    assert states == 67 * ["tracking"] + 13 * ["lost"]


@pytest.mark.long
@pytest.mark.real_data
def test_a_real_building_without_odometry_where_a_scan_fits_in_one_place_and_nearly_in_another(data):
    """In Freiburg's building 101, after a break: half of the scan fits 6.8 m away, turned by nearly half a turn.

    Taken for the wrong one, relative poses were 4.7 m off in the mean. Walls far ahead tell which is right.
    """
    scans = list(open_recording(data / "carmen_radish_corrected" / "freiburg-101-corrected.log.gz"))
    found = study(*prepared(scans, "none", 0), MapperSettings())
    assert found.wrong == 0
    assert found.pairs[:, 0].mean() < 0.045
    assert found.tracked == found.scans
