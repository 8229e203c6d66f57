"""What ties a map: a loop that is found again, when the map is finished, is no other one."""

import numpy as np
import pytest

from lidarcore import open_recording
from lidarcore.evaluation.maps.study import prepared
from lidarcore.mapping import Mapper
from tests.mapping.mapping_scenes import SETTINGS, drive, full_scan, way


@pytest.mark.real_data
def test_a_loop_that_is_found_again_ties_the_map_only_once(data):
    """A loop that others contradict counts for little, so that its place is sought, and found, once more.

    Three of 33 were tied twice.
    """
    scans, _ = prepared(
        list(open_recording(data / "carmen_radish_corrected" / "intel-corrected.log.gz")), "poor", 0
    )
    mapper = Mapper()
    for scan in scans[:150]:
        mapper.step(scan)
    mapper.finish()
    tied = [(loop.i, loop.j) for loop in mapper.loops]
    assert len(tied) > 20
    assert len(set(tied)) == len(tied)


def test_the_same_loop_twice_leaves_a_map_as_it_is():
    mapper = Mapper(SETTINGS)
    for scan in drive(way(0.8, 1.5), np.random.default_rng(0), scanned=full_scan):
        mapper.step(scan)
    back = mapper._back
    loops, edges, poses = list(back.loops), len(back.graph.edges), back.graph.poses
    assert len(loops) > 3
    assert back._close(loops + loops) == 0
    assert back.loops == loops
    assert len(back.graph.edges) == edges
    np.testing.assert_array_equal(back.graph.poses, poses)
