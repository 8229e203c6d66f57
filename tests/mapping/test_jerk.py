"""Speeds told by places, against integrals, a Kalman smoother of the same motion, and drives that are known."""

import numpy as np
import pytest
from jerky_motions import motions, only
from scipy.linalg import expm
from scipy.optimize import minimize

from lidarcore.mapping.motion.jerk import JERKS, STEADY, Drive, _most_likely, estimated, kinds, window
from lidarcore.mapping.motion.jerk_fits import evidences
from lidarcore.mapping.motion.smoothing import UNTOLD

T = np.arange(-3, 4) / 10
SIGMA = np.array([1e-3, 2e-3, 5e-4])


def around(places, variances=SIGMA**2, h=0.0, told=None, speeds=UNTOLD):
    """A window around the middle of seven places (N, 7, 3), a tenth of a second apart."""
    n = len(places)
    told = np.ones((n, 7), bool) if told is None else told
    return window(
        told,
        np.tile(T, (n, 1)),
        np.full(n, h),
        places,
        np.broadcast_to(variances, places.shape),
        np.broadcast_to(speeds, (n, 2, 3)),
    )


def wandered(rng, n, jerk, step=1e-3):
    """Places (n, 7) of one dimension, with speed and acceleration (n,) in their middle, of motions with white jerk."""
    each = round(0.1 / step)
    states = motions(rng, n, jerk, 6 * each, step)[:, ::each]
    return states[:, :, 0], states[:, 3, 1], states[:, 3, 2]


@pytest.mark.parametrize("number", [1, 3])
def test_one_density_gives_what_a_kalman_filter_forth_and_back_gives(number):
    jerk = JERKS[number]
    rng = np.random.default_rng(number)
    places = rng.normal(0, 0.002, (1, 7, 3)) + np.stack([0.7 * T, -0.1 * T**2, 0.4 * T], -1)
    rates, C, _ = estimated(around(places), only(number))
    for d in range(3):
        m, P = fused(places[0, :, d], SIGMA[d] ** 2, jerk[d], [1, 10, (1, 1, 2)[d]])
        np.testing.assert_allclose(rates[0, :, d], m[1:], rtol=1e-5, atol=1e-7)
        np.testing.assert_allclose(C[0, d], P[1:, 1:], rtol=1e-4, atol=1e-9)


def test_a_speed_that_is_told_besides_counts_as_one_more_measurement():
    """Of a scale to matter: as certain as the places make it, and 20 mm/s and 10 mrad/s off what they say."""
    rng, jerk, number = np.random.default_rng(3), JERKS[2], 2
    places = rng.normal(0, 0.002, (1, 7, 3)) + np.stack([0.7 * T, -0.1 * T**2, 0.4 * T], -1)
    without, before, _ = estimated(around(places), only(number))
    speed, variances = without[0, 0] + [0.02, 0.02, -0.01], before[0, :, 0, 0]
    rates, C, _ = estimated(around(places, speeds=np.stack([speed, variances])), only(number))
    for d in range(3):
        m, P = fused(places[0, :, d], SIGMA[d] ** 2, jerk[d], [1, 10, (1, 1, 2)[d]])
        gain = P[:, 1] / (P[1, 1] + variances[d])
        np.testing.assert_allclose(rates[0, :, d], (m + gain * (speed[d] - m[1]))[1:], rtol=1e-5, atol=1e-7)
        np.testing.assert_allclose(C[0, d], (P - np.outer(gain, P[1]))[1:, 1:], rtol=1e-4, atol=1e-9)
    assert (np.abs(rates - without)[0, 0] > 0.004).all()


def fused(y, variance, jerk, usual):
    """State in the middle, by a filter over the places on either side that starts where nothing is known but it."""
    information, vector = np.diag(np.array(usual, float) ** -2), np.zeros(3)
    H = np.array([[1.0, 0, 0]])
    for way in (1, -1):
        # Backward in time for places, speeds and accelerations: the transition from the middle on, kept jointly.
        F = np.array([[0, 1, 0], [0, 0, 1], [0, 0, 0]]) * way
        steps = y[3:] if way > 0 else y[3::-1]
        joint, mean = np.block([[np.diag([1e4, 1e4, 1e4])] * 2] * 2), np.zeros(6)  # middle, and the present
        for k, place in enumerate(steps):
            if k:
                A = expm(F * 0.1)
                Q = np.zeros((3, 3))
                G = np.array([[0], [0], [1.0]])
                nodes, weights = np.polynomial.legendre.leggauss(8)
                for u, w in zip(0.05 * (nodes + 1), 0.05 * weights, strict=True):
                    g = expm(F * u) @ G
                    Q += w * jerk**2 * g @ g.T
                B = np.block([[np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), A]])
                joint = B @ joint @ B.T
                joint[3:, 3:] += Q
                mean = B @ mean
            if k or way > 0:
                R = np.concatenate([np.zeros((1, 3)), H], 1)
                K = joint @ R.T / (R @ joint @ R.T + variance)
                mean, joint = mean + (K @ (place - R @ mean)).ravel(), joint - K @ R @ joint
        W = np.linalg.inv(joint[:3, :3])
        information, vector = information + W - 1e-4 * np.eye(3), vector + W @ mean[:3]
    P = np.linalg.inv(information)
    return P @ vector, P


def test_the_claims_hold_for_motions_whose_jerkiness_nobody_told():
    """4,000 windows: a claim too small by a tenth has means of squares beyond 1.2, 9 standard deviations away."""
    rng = np.random.default_rng(5)
    n = 4000
    quiet, rough = (wandered(rng, n // 2, jerk) for jerk in (0.3, 3.0))
    y, v, a = (np.concatenate(pair) for pair in zip(quiet, rough, strict=True))
    places = np.zeros((n, 7, 3))
    places[:, :, 0] = y + rng.normal(0, SIGMA[0] / 2, y.shape)  # half as noisy as it says
    places -= places[:, 3:4]
    places[:, :, 1:] = rng.normal(0, SIGMA[1:] / 2, (n, 7, 2))
    order = rng.permutation(n)
    told = around(places[order])
    drive = Drive.of(told)
    assert drive.noise == 0.25
    of_three = np.isclose(drive.densities[:, :2, 0], 3.0)
    assert all(drive.shares[which, 0].sum() > 0.2 for which in of_three.T)
    rates, C, _ = estimated(told, drive)
    off = rates[:, :, 0] - np.stack([v, a], -1)[order]
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(C[:, 0]), off) / 2
    assert 0.85 < squares.mean() < 1.15


def test_where_a_steady_drive_has_a_jolt_its_speed_is_told_and_claimed():
    """3,000 windows, one jolt of 1 m/s² or so in a quarter. With jerk that is spread over both sides of the time alone,
    speeds beside a jolt are 5 mm/s off, and squares are 1.4 times as large as claimed."""
    rng, n, sigma = np.random.default_rng(4), 3000, 1e-4
    at, size = rng.uniform(-1.5, 1.5, n)[:, None], rng.normal(0, 1.0, (n, 1))
    speed, acceleration = rng.normal(0, 0.5, (n, 1)), rng.normal(0, 0.3, (n, 1))
    beyond = np.abs(T) > np.abs(at)
    jolted = np.where(beyond & (T * at > 0), size * (T - at) ** 2 / 2, 0.0)
    y = speed * T + acceleration * T**2 / 2 + jolted + rng.normal(0, sigma, (n, 7))
    places = np.zeros((n, 7, 3))
    places[:, :, 0] = y - y[:, 3:4]
    places[:, :, 1:] = rng.normal(0, sigma, (n, 7, 2))
    told = around(places, np.full(3, sigma**2))
    rates, C, _ = estimated(told, Drive.of(told))
    off = (rates[:, 0, 0] - speed[:, 0])[np.abs(at[:, 0]) < 0.1]
    squares = off**2 / C[np.abs(at[:, 0]) < 0.1, 0, 0, 0]
    assert np.sqrt((off**2).mean()) < 0.003
    assert 0.7 < squares.mean() < 1.3


def test_no_other_shares_of_jerks_explain_places_better():
    """Against a solver for any function of shares that are positive and sum up to 1."""
    rng = np.random.default_rng(8)
    y = np.concatenate([wandered(rng, 40, jerk, step=0.01)[0] for jerk in (0.03, 0.3, 3.0)])
    places = np.zeros((120, 7, 3))
    places[:, :, 0] = y - y[:, 3:4] + rng.normal(0, SIGMA[0], y.shape)
    given, some = around(places), np.arange(120)
    found = np.empty((len(JERKS), 120, 3))
    evidences(given, some, 1.0, STEADY.densities, found)
    likelihoods = np.exp(found[:, :, 0])
    solved = minimize(
        lambda shares: -np.log(shares @ likelihoods).mean(),
        np.full(len(JERKS), 1 / len(JERKS)),
        bounds=[(1e-9, 1)] * len(JERKS),
        constraints={"type": "eq", "fun": lambda shares: shares.sum() - 1},
    )
    shares = _most_likely(given, some, 1.0, STEADY)[1][:, 0]
    assert solved.success
    assert shares.sum() == pytest.approx(1)
    assert -np.log(shares @ likelihoods).mean() - solved.fun < 0.0003


@pytest.mark.parametrize(
    ("there", "lasts"),
    [
        (np.ones(7), [0.25, 0.05, 0.05, 0.05, 0.05, 0.25]),
        ([0, 0, 0, 1, 1, 1, 1], [0.0, 0.0, 0.05, 0.05, 0.05, 0.25]),
        ([0, 0, 1, 1, 0, 0, 0], [0.05, 0.05, 0.05, 0.05, 0.0, 0.0]),
        ([0, 0, 0, 1, 0, 0, 0], [0.0, 0.0, 0.05, 0.05, 0.0, 0.0]),
    ],
)
def test_a_jolt_is_as_likely_at_any_time_that_the_places_cover(there, lasts):
    """Sweeps of 0.1 s, one after another: those that are told, the one in the middle among them."""
    told = np.array([there], bool)
    given = around(np.zeros((1, 7, 3)), h=0.05, told=told)
    np.testing.assert_allclose(given.lasts, lasts, atol=1e-12)
    of = kinds(given.lasts)
    assert (of.densities[: of.first[len(JERKS)]] == STEADY.densities).all()
    jolts = of.densities[of.first[len(JERKS)] :, :, 0].reshape(-1, 6, 6)
    often = of.often[of.first[len(JERKS)] :].reshape(-1, 6)
    assert len(jolts) == len(JERKS) * (len(JERKS) - 1) / 2
    for densities, shares in zip(jolts, often, strict=True):
        steady, jolted = np.unique(densities)
        assert (densities == np.where(np.eye(6), jolted, steady)).all()
        np.testing.assert_allclose(shares, np.array(lasts) / sum(lasts))


def test_what_scatters_about_a_steady_way_is_noise_and_no_jerk():
    """Twelve drives of 300 places each; with all jerks taken for as frequent, noise came out a quarter too small."""
    rng, found = np.random.default_rng(3), []
    for _ in range(12):
        off = rng.normal(0, SIGMA[0], (306, 3))
        places = np.stack([off[k : k + 300] for k in range(7)], 1)
        found.append(Drive.of(around(places - places[:, 3:4], SIGMA[0] ** 2, h=0.05)).noise)
    mean = np.exp(np.mean(np.log(found)))
    print(mean)
    assert 0.85 < mean < 1.15


@pytest.mark.parametrize("never", [0, 4, 8])
def test_a_density_that_never_is_the_one_counts_for_nothing_in_that_dimension(never):
    """Beside those that are, one at a time, as if it were not there; the others keep their shares."""
    given = around(np.random.default_rng(4).normal(0, 0.01, (5, 7, 3)))
    shares = np.full((len(JERKS), 3), 1 / len(JERKS))
    rest = np.arange(len(JERKS)) != never
    shares[never, 1] = 0.0
    found = estimated(given, Drive(1.0, STEADY.densities, shares))
    without = estimated(given, Drive(1.0, STEADY.densities[rest], shares[rest]))
    usual = estimated(given, Drive(1.0, STEADY.densities, np.full(shares.shape, 1 / len(JERKS))))
    for one, two, three, axis in zip(found, without, usual, (2, 1, 2), strict=True):
        np.testing.assert_allclose(one.take(1, axis), two.take(1, axis), rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(one.take([0, 2], axis), three.take([0, 2], axis), rtol=1e-9, atol=1e-15)
        assert not np.allclose(one.take(1, axis), three.take(1, axis), rtol=1e-4, atol=0)


def test_a_place_that_is_not_told_says_nothing():
    rng = np.random.default_rng(2)
    places = rng.normal(0, 0.002, (5, 7, 3))
    told = np.ones((5, 7), bool)
    told[:, [0, 5]] = False
    other = places.copy()
    other[:, [0, 5]] = 1e3
    for one, two in zip(
        estimated(around(places, told=told), only(2)),
        estimated(around(other, told=told), only(2)),
        strict=True,
    ):
        np.testing.assert_array_equal(one, two)


def test_the_error_of_its_own_place_is_in_the_speed_of_a_scan_at_an_end_and_not_in_that_between_others():
    """20,000 windows each: by chance a mean of products is off by 1 % of both deviations' product, rarely by 4."""
    rng = np.random.default_rng(3)
    n, jerk = 20_000, JERKS[2, 0]
    y, v, a = wandered(rng, n, jerk, step=0.01)
    errors = rng.normal(0, SIGMA[0], y.shape)
    places = np.zeros((n, 7, 3))
    places[:, :, 0] = y - y[:, 3:4] + errors
    claims = {}
    for where, told in (("first", [0, 0, 0, 1, 1, 1, 1]), ("between", np.ones(7))):
        rates, C, with_place = estimated(around(places, told=np.tile(np.array(told, bool), (n, 1))), only(2))
        off = rates[:, :, 0] - np.stack([v, a], -1)
        true, sigma = (off * errors[:, 3:4]).mean(axis=0), SIGMA[0] * off.std(axis=0)
        assert (np.abs(with_place[0, :, 0] - true) < 0.04 * sigma).all()
        claims[where] = with_place[0, 0, 0] / (SIGMA[0] * np.sqrt(C[0, 0, 0, 0]))
    assert claims["first"] < -0.5
    assert abs(claims["between"]) < 1e-3
