"""How far a scan is misplaced for a wrong speed, against scans that are misplaced."""

from dataclasses import replace

import numpy as np
import pytest
from mapping_scenes import NOISE

from lidarcore import Scan
from lidarcore.geometry import pose_difference
from lidarcore.mapping import MatchSettings
from lidarcore.mapping.matching.distortion import own_variances, pose_shift
from lidarcore.mapping.matching.patches import joined, patches
from lidarcore.mapping.matching.registration import register
from lidarcore.mapping.matching.surfels import surfels
from lidarcore.mapping.motion.sweep import half_time, without
from lidarcore.simulation import SimulatedSensor
from lidarcore.simulation.rooms import box, rectangular_room
from lidarcore.simulation.world import World

MATCH = MatchSettings(noise=NOISE)
ROOM = World(np.concatenate([rectangular_room(16, 9).walls, box(2.0, -3.0, 3.0, 1.0, 0.3)]))
HERE = np.array([-5.0, 1.5, 0.4])
TIMES = np.linspace(0, 0.1, 900, endpoint=False)
NOTHING = np.zeros(3)


def seen(offset: float) -> Scan:
    """Without noise, by a sensor that stands."""
    bearings = 2 * np.pi * (np.arange(900) + offset) / 900 - np.pi
    return Scan(ROOM.cast(HERE, bearings)[0], bearings, beam_times=TIMES)


@pytest.mark.parametrize("wrong", np.eye(3) * [0.1, 0.1, 0.02])
@pytest.mark.parametrize("degree", [0, 1])
def test_a_scan_without_a_motion_that_was_none_is_found_where_it_says(wrong, degree):
    """The sensor stands, and is taken to move: in the mean time of the beams it is found beside where it is."""
    reference = surfels(joined([patches(seen(k / 4), MATCH) for k in range(4)]), MATCH.patch, MATCH.reach)
    scan = seen(0.6)
    motion = [NOTHING, NOTHING]
    motion[degree] = wrong * (10 if degree else 1)
    bent = without(scan, *motion)
    found = register(reference, patches(bent, MATCH), NOTHING, NOTHING, 1e-9 * np.eye(3), MATCH.reach).pose
    h = half_time(scan)
    # It stands where its stamp is: seen from there, the mean time is as far away as the motion leads.
    at_mean = found + h * motion[0] - h**2 / 3 * motion[1]
    expected = pose_shift(scan, patches(scan, MATCH))[degree] @ motion[degree]
    np.testing.assert_allclose(pose_difference(at_mean, NOTHING), expected, rtol=0.1, atol=1e-4)


def test_a_turn_that_was_none_shifts_a_scan_in_a_lopsided_room():
    """So the first test has something to tell: 1 rad/s too much is 3 cm and more."""
    assert np.hypot(*pose_shift(seen(0.0), patches(seen(0.0), MATCH))[0, :2, 2]) > 0.03


@pytest.mark.parametrize("unevenness", [0.0, 0.005, 0.02])
def test_scans_of_a_sensor_that_stands_scatter_as_their_own_noise_says(unevenness):
    """200 scans in a room whose walls are known: their variances are right to 10 %. Walls do not move in between."""
    settings = replace(MATCH, unevenness=unevenness)
    reference = surfels(joined([patches(seen(k / 4), settings) for k in range(4)]), MATCH.patch, MATCH.reach)
    sensor, rng, found, claimed = SimulatedSensor(ROOM, NOISE), np.random.default_rng(4), [], []
    for _ in range(200):
        own = patches(replace(sensor.scan(HERE, rng)[0], beam_times=None), settings)
        found.append(register(reference, own, NOTHING, NOTHING, np.eye(3), MATCH.reach).pose)
        claimed.append(own_variances(own, unevenness))
    ratio = np.var(found, axis=0) / np.mean(claimed, axis=0)
    print(ratio)
    assert (np.abs(ratio - 1) < 0.3).all()


def test_a_scan_taken_at_once_or_of_nothing_is_never_shifted():
    scan = seen(0.0)
    at_once = replace(scan, beam_times=None)
    empty = replace(scan, ranges=np.full(900, np.nan))
    for one in (at_once, empty):
        assert not pose_shift(one, patches(one, MATCH)).any()
    assert (own_variances(patches(empty, MATCH), MATCH.unevenness) >= 1).all()  # it may be anywhere
    assert half_time(at_once) == 0
