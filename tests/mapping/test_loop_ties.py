"""What ties a map: loops of the Intel Research Lab, most of which are found again when the map is finished."""

import pytest

from lidarcore import open_recording
from lidarcore.evaluation.maps.study import prepared
from lidarcore.mapping import Mapper


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
