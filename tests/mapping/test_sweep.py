"""The motion within a scan by where scans are found, against motions that are known."""

import numpy as np
import pytest

from lidarcore import Scan
from lidarcore.geometry import compose, inverse
from lidarcore.mapping.motion.sweep import Sweep, along_arc, arc_end

PERIOD, HALF = 0.1, 0.05  # s
TIMES = np.linspace(0, 2 * HALF, 101)


def driven(velocity, steps=20_000, end=2.0):
    """Times (N,) and poses (N, 3) of a sensor that moves at velocity(times) (N, 3), in small steps."""
    times = np.linspace(0, end, steps + 1)
    moved = velocity((times[1:] + times[:-1]) / 2) * end / steps
    headings = np.cumsum(np.append(0, moved[:, 2]))
    middle = headings[:-1] + moved[:, 2] / 2
    dx, dy = moved[:, 0], moved[:, 1]
    x = np.cumsum(np.append(0, np.cos(middle) * dx - np.sin(middle) * dy))
    y = np.cumsum(np.append(0, np.sin(middle) * dx + np.cos(middle) * dy))
    return times, np.stack([x, y, headings], -1)


def found(places, half=HALF):
    """Velocities (T, 3) and claims (T, 3) of scans that are found at places (T, 3) in the mean time of their beams.

    That is `half` s after their stamps.
    """
    sweep = Sweep()
    scan = Scan(np.full(101, 2.0), np.linspace(-3, 3, 101), beam_times=TIMES - HALF + half)
    velocities, claims, last = [], [], None
    for place in places:
        sweep.remove(scan, None, None)
        now = compose(place, inverse(arc_end(half * sweep.removed)))
        if last is not None:
            sweep.correct(scan, last, now, PERIOD)
        last = compose(place, inverse(arc_end(half * sweep.removed)))
        velocities.append(sweep.removed)
        claims.append(np.diag(sweep.covariance))
    return np.array(velocities), np.array(claims)


def on_the_way(velocity, count=15):
    """Places (T, 3) in the mean times of scans, and these."""
    times, poses = driven(velocity)
    middle = PERIOD * np.arange(count) + HALF
    return np.stack([np.interp(middle, times, column) for column in poses.T], -1), middle


@pytest.mark.parametrize("way", [1, -1])
def test_a_steady_acceleration_is_followed(way):
    """From the fourth scan on. What lags by a scan is 0.1 rad/s and 50 mm/s off."""

    def velocity(t):
        return way * np.stack([0.2 + 0.5 * t, 0.05 - 0.3 * t, 1.0 * t], -1)

    places, middle = on_the_way(velocity)
    velocities, _ = found(places)
    np.testing.assert_allclose(velocities[6:], velocity(middle[6:]), atol=2e-3)


def test_a_steady_motion_is_told_without_error_and_claimed_to_be():
    places, middle = on_the_way(lambda t: np.stack([0.5 + 0 * t, 0.1 + 0 * t, 0.7 + 0 * t], -1))
    velocities, claims = found(places)
    np.testing.assert_allclose(velocities[8:], np.tile([0.5, 0.1, 0.7], (len(middle) - 8, 1)), atol=1e-4)
    assert (claims[12:] < 1e-12).all()


def test_a_jolt_is_claimed_while_it_is_not_followed():
    """The turn begins at once, with 2 rad/s²: the scan in which it does cannot tell, later ones that are off by more
    than 1 mrad say that they may be."""

    def velocity(t):
        turn = 2.0 * np.maximum(t - 0.7, 0.0)
        return np.stack([0 * t, 0 * t, turn], -1)

    places, middle = on_the_way(velocity)
    velocities, claims = found(places)
    off = HALF * np.abs(velocities - velocity(middle))[:, 2]
    first, *later = np.flatnonzero(off > 1e-3)
    assert first == 7
    assert len(later) <= 3  # what lags by a scan stays 10 mrad off
    assert (off[later] < 2 * np.sqrt(claims[later, 2])).all()


def test_noise_of_places_is_not_taken_for_a_change_of_speed():
    """Of 5,000 scans at rest: velocities scatter less than the way from scan to scan does, and claims say how much."""
    rng, sigma = np.random.default_rng(1), 1e-3
    places = rng.normal(0, sigma, (5000, 3))
    velocities, claims = found(places)
    of_ways = np.sqrt(2) * sigma / PERIOD
    assert (velocities.std(axis=0) < of_ways).all()
    shares = (HALF * velocities).var(axis=0) / claims.mean(axis=0)
    assert ((shares > 0.3) & (shares < 1.0)).all()


@pytest.mark.parametrize("half", [0.0, HALF, 2 * HALF])
def test_scans_that_are_stamped_after_their_beams_tell_and_claim_the_same(half):
    places = np.random.default_rng(2).normal(0, 1e-3, (100, 3))
    velocities, claims = found(places, half=half)
    for told, same in zip(found(places, half=-half), (velocities, claims), strict=True):
        np.testing.assert_allclose(told, same, atol=1e-6)


@pytest.mark.parametrize("covered", [[0.3, 0.1, 0.8], [0.3, -0.1, -2.0], [0.1, 0.2, 0.0]])
def test_where_an_arc_ends_is_where_small_steps_lead(covered):
    end = driven(lambda t: np.tile(np.array(covered) / 2.0, (len(t), 1)))[1][-1]
    np.testing.assert_allclose(arc_end(np.array(covered)), end, atol=1e-7)
    np.testing.assert_allclose(along_arc(end), covered, atol=1e-7)


def test_a_scan_whose_beams_are_older_than_those_of_the_one_before_tells_no_motion():
    sweep = Sweep()
    late, early = (
        Scan(np.full(101, 2.0), np.linspace(-3, 3, 101), beam_times=times) for times in (TIMES + 1.0, TIMES)
    )
    sweep.remove(late, None, None)
    sweep.remove(early, None, None)
    assert sweep.correct(early, np.zeros(3), np.array([0.1, 0.0, 0.0]), PERIOD) is early
    assert (sweep.removed == 0).all()
