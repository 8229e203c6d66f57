"""Places and trials against the world they are in, and against fits one by one."""

from itertools import islice

import numpy as np
import pytest

from lidarcore import FITTERS, ExtractionSettings, SensorNoise, extract
from lidarcore.evaluation.consistency.cramer_rao import corner_bound
from lidarcore.evaluation.consistency.design import ROOMS, room
from lidarcore.evaluation.consistency.places import MIN_BEAMS, places
from lidarcore.evaluation.consistency.trials import measure, most_met, simulate
from lidarcore.scan import Scan

NOISE = SensorNoise(0.02, 0.002)
SETTINGS = ExtractionSettings(noise=NOISE)


@pytest.fixture(params=["4.5x2.5", *ROOMS], scope="module")
def spots(request):
    return list(islice(places(room(request.param), NOISE, 720, np.random.default_rng(5)), 25))


def lines_of(spot, p):
    """Bearings of the beams on both walls of a corner, and their lines through the first and the last point."""
    bearings, lines = [], []
    for first, count in zip(spot.first[p], spot.count[p], strict=True):
        theta, rho = spot.bearings[first : first + count], spot.ranges[first : first + count]
        z = rho * np.exp(1j * theta)
        direction = (z[-1] - z[0]) / abs(z[-1] - z[0])
        assert abs(((z - z[0]) * direction.conjugate()).imag).max() < 1e-9  # all on one straight wall
        normal = -1j * direction
        r = (z[0] * normal.conjugate()).real
        bearings.append(theta)
        lines.append((np.angle(normal * np.sign(r)), abs(r)))
    return bearings, lines


def test_a_corner_is_where_its_two_walls_meet_between_neighbouring_beams(spots):
    assert sum(len(spot.corners) for spot in spots) >= 25
    for spot in spots:
        for p, (x, y) in enumerate(spot.corners):
            bearings, ((a, r), (b, d)) = lines_of(spot, p)
            N = np.array([[np.cos(a), np.sin(a)], [np.cos(b), np.sin(b)]])
            assert np.allclose(N @ [x, y], [r, d], atol=1e-9)
            assert (spot.count[p] >= MIN_BEAMS).all()
            past = np.exp(1j * np.array([bearings[0][-1], bearings[1][0]])) / np.exp(1j * np.arctan2(y, x))
            assert past[0].imag <= 0 <= past[1].imag
            assert np.abs(np.angle(past)).max() < 2 * np.pi / 720


def test_bounds_of_a_place_are_those_of_its_walls(spots):
    for spot in spots:
        for p, bound in enumerate(spot.bounds):
            bearings, lines = lines_of(spot, p)
            assert np.allclose(bound, corner_bound(tuple(lines), tuple(bearings), NOISE), rtol=1e-6, atol=0)


def test_a_measured_scan_is_sorted_and_has_the_errors_it_was_given(spots):
    rng, n = np.random.default_rng(1), 720
    for spot in spots:
        errors = rng.normal(0, 1, (2, n)) * [[0.02], [0.01]]  # beams swap places, and some pass the seam
        ranges, bearings, hit = np.empty(n), np.empty(n), np.empty(n, np.int64)
        measure(spot.ranges, spot.bearings, spot.hit, errors, ranges, bearings, hit)
        expected = (spot.bearings + errors[1] + np.pi) % (2 * np.pi) - np.pi
        order = np.argsort(expected)
        assert np.allclose(bearings, expected[order], rtol=0, atol=1e-14)
        assert (hit == spot.hit[order]).all()
        assert np.allclose(ranges, (spot.ranges + errors[0])[order], rtol=0, atol=1e-14)


def test_trials_with_segments_known_are_the_fits_one_by_one(spots):
    for spot in spots[:5]:
        trials = simulate([spot], "known", SETTINGS, 2, np.random.default_rng(9))
        errors = np.random.default_rng(9).standard_normal((2, 2, 720)) * [[0.02], [0.002]]
        for name, fitter in FITTERS.items():
            for p, corner in enumerate(spot.corners):
                for k in range(2):
                    slices = [slice(a, a + n) for a, n in zip(spot.first[p], spot.count[p], strict=True)]
                    lines = [
                        fitter.fit(
                            spot.ranges[beams] + errors[k, 0, beams],
                            spot.bearings[beams] + errors[k, 1, beams],
                            NOISE,
                        )
                        for beams in slices
                    ]
                    found = np.linalg.solve([line.normal for line in lines], [line.r for line in lines])
                    assert np.allclose(trials[name, "published"].errors[p, k], found - corner, atol=1e-9)


def test_trials_with_segments_found_are_corners_of_extraction(spots):
    """And every corner of extraction close to a true one counts as found."""
    for i, spot in enumerate(spots):
        trials = simulate([spot], "found", SETTINGS, 1, np.random.default_rng(i))["ml", "published"]
        errors = np.random.default_rng(i).standard_normal((1, 2, 720)) * [[0.02], [0.002]]
        corners = extract(Scan(spot.ranges + errors[0, 0], spot.bearings + errors[0, 1]), SETTINGS).corners
        for p, corner in enumerate(spot.corners):
            e = trials.errors[p, 0]
            if np.isfinite(e).all():
                same = np.abs(corners.xy - (corner + e)).max(1) < 1e-9
                assert same.sum() == 1
                assert np.allclose(corners.covariance_published[same][0], trials.covariances[p, 0], rtol=1e-6)
            else:
                assert (np.linalg.norm(corners.xy - corner, axis=1) > 0.02).all()


@pytest.mark.parametrize(("first", "last"), [(0, 9), (7, 2), (4, 4), (3, 1)])
def test_the_wall_most_met_has_more_than_half_of_the_beams(first, last):
    rng = np.random.default_rng(first)
    for _ in range(200):
        hit = rng.integers(-1, 3, 10)
        inside = hit[np.arange(first, last + 1 + 10 * (last < first)) % 10]
        walls, counts = np.unique(inside, return_counts=True)
        expected = walls[counts.argmax()] if 2 * counts.max() > len(inside) else -1
        assert most_met(hit, first, last) == expected
