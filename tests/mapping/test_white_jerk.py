"""What white jerk adds to what sweeps show, against impulses one by one and motions that are simulated."""

import numpy as np
import pytest
from jerky_motions import motions, only

from lidarcore.mapping.motion.jerk import JERKS, estimated, window
from lidarcore.mapping.motion.white_jerk import STRETCHES, wander

H = 0.05  # s, half a sweep
T = np.array([-0.11, 0.0, 0.1, 0.2])


def moved(t, u):
    """Places at t (N,) s after an impulse of jerk at u s, if nothing changes at 0 s."""
    beyond = (np.abs(t) > abs(u)) & (np.sign(t) == np.sign(u))
    return np.where(beyond, np.sign(u) * (t - u) ** 2 / 2, 0.0)


def shown(place):
    """What sweeps show of places: means around T, the slope of the line through the one around 0 s, and its bend."""
    beams = H * (np.arange(-1000, 1000) + 0.5) / 1000
    means = [place(beams + t).mean() for t in T]
    own = place(beams)
    begins = place(np.array([-H]))[0] - own.mean()
    return [*means, (beams * own).sum() / (beams**2).sum(), 3 * begins / H**2]


def test_covariances_add_up_what_impulses_one_by_one_do():
    covariances = np.empty((1, STRETCHES, 6, 6))
    wander(T[None], np.array([H]), covariances)
    times = (np.arange(-300, 300) + 0.5) / 1000
    added = np.array([shown(lambda t, u=u: moved(t, u)) for u in times])
    stretch = np.searchsorted([-0.1, -H, 0, H, 0.1], times)
    for number, covariance in enumerate(covariances[0]):
        some = added[stretch == number]
        np.testing.assert_allclose(covariance, some.T @ some / 1000, rtol=2e-3, atol=1e-3 * covariance.max())


@pytest.mark.parametrize("told", [np.ones(7), [0, 0, 0, 1, 1, 1, 1]])
def test_a_sweep_begins_as_far_from_where_it_is_said_to_as_is_claimed(told):
    """8,000 motions, between two neighbours and at an end, with a speed that the sweep itself tells: a mean of squares
    is off by 1.6 %, rarely by 5."""
    rng, n, step = np.random.default_rng(2), 8000, 0.0025
    places = motions(rng, n, JERKS[3, 0], round(2 * (0.3 + H) / step), step)[..., 0]
    beams = np.arange(-round(H / step), round(H / step) + 1)
    weights = np.where(np.abs(beams) == beams[-1], 0.5, 1.0) / (len(beams) - 1)
    middle = places.shape[1] // 2
    steps = np.arange(-3, 4) * round(0.1 / step)
    means = np.stack([places[:, middle + s + beams] @ weights for s in steps], 1)
    slope = places[:, middle + beams] @ (weights * beams) / (weights @ beams**2 * step)
    noise, of_speed = 5e-5, 1e-3
    seen = means + rng.normal(0, noise, means.shape)
    given, speeds = np.zeros((n, 7, 3)), np.zeros((n, 2, 3))
    given[..., 0] = seen - seen[:, 3:4]
    speeds[:, 0, 0], speeds[:, 1] = slope + rng.normal(0, of_speed, n), of_speed**2
    on, at = np.tile(np.array(told, bool), (n, 1)), np.tile(steps * step, (n, 1))
    seven = window(on, at, np.full(n, H), given, np.full((n, 7, 3), noise**2), speeds)
    rates, spread, _ = estimated(seven, only(3))
    lever = np.array([-H, H**2 / 3])
    off = rates[:, :, 0] @ lever - (places[:, middle + beams[0]] - means[:, 3])
    assert (off**2 / (lever @ spread[0, 0] @ lever)).mean() == pytest.approx(1, abs=0.08)
