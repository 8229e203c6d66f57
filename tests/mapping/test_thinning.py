"""A map of a place where a robot drives round and round: what it keeps is bounded, and says the same."""

from dataclasses import replace

import numpy as np
from mapping_scenes import drive, full_scan, way

from lidarcore.geometry import UncertainPose, relative
from lidarcore.mapping.loops.back import BackEnd
from lidarcore.mapping.loops.thinning import spare
from lidarcore.mapping.matching.front import FrontEnd
from lidarcore.mapping.settings import MapperSettings


def test_of_many_views_the_first_and_the_last_stay():
    nodes = np.arange(100, 300)
    poses = np.tile([1.1, 1.1, 0.1], (200, 1))
    gone = spare(nodes, poses)
    assert gone.tolist() == list(range(103, 250))  # three first ones, and the newest 50


def test_views_from_other_places_and_in_other_directions_are_counted_apart():
    views = np.array([[x + 0.25, 0.25, turn + 0.1] for x in range(4) for turn in (0, 0.8, 1.6, 3.2, -0.5)])
    poses = np.repeat(views, 6, axis=0)
    recent = np.tile([50.0, 50.0, 0.0], (50, 1))
    assert not len(spare(np.arange(170), np.concatenate([poses, recent])))
    twice = np.concatenate([poses, poses, recent])
    assert len(spare(np.arange(290), twice)) == 20 * 6


def test_a_map_that_is_thinned_still_closes_loops_and_ends_where_the_robot_is():
    """A robot that drives around a building twelve times, each time on the same way and with the same scans."""
    front, poses = FrontEnd(MapperSettings().front), way(0.3, 1.0)
    scans = drive(poses, np.random.default_rng(5), scanned=full_scan)
    placed = [(one, pose) for one, pose in zip(map(front.step, scans), poses, strict=True) if one.keyframe]
    to_start = relative(placed[-1][1], placed[0][1])
    first, again = placed[0][0], placed[1][0].tie.covariance
    back, before, kept = BackEnd(MapperSettings()), 0, []
    for _ in range(12):
        for one, _ in placed:
            node = before + one.node
            if before and one is first:
                tie = UncertainPose(to_start, again)
                back.add(replace(one, node=before - 1, tie=tie, moved=tie))
            else:
                back.add(replace(one, node=node, first=None if before else one.first))
        before += len(placed)
        back.thin()
        kept.append(len(back.keyframes))
    assert len(back.graph) == 12 * len(placed)
    assert kept[-1] < 0.8 * len(back.graph)
    assert kept[-1] - kept[-2] < 0.2 * len(placed)
    assert back.loops[-1].j > len(back.graph) - len(placed)
    here, there = back.graph.poses[-1], relative(placed[0][1], placed[-1][1])
    assert np.hypot(*(here - there)[:2]) < 0.1
