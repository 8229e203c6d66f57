"""Scan matching against known motion, brute force and finite differences."""

import numpy as np
import pytest
from matching_scenes import GUESS, full_scan, matched, sick_scan, squared, step_from
from scipy.spatial import cKDTree
from scipy.stats import chi2

from lidarcore import Scan, SensorNoise
from lidarcore.errors import LocalizationError
from lidarcore.poses import compose
from lidarcore.scanmatching import LoopSettings, MatchSettings, match_scans, surface
from lidarcore.scanmatching.correlative import search
from lidarcore.scanmatching.pairing import pair
from lidarcore.simulation import furnished_room, random_pose
from lidarcore.simulation.rooms import rectangular_room

FINE, COARSE = SensorNoise(0.01, 0.001), SensorNoise(0.02, 0.0045)


@pytest.mark.parametrize(
    ("scanned", "noise", "most"), [(full_scan, FINE, 0.002), (sick_scan, COARSE, 0.01)], ids=["360", "180"]
)
def test_matches_are_accurate_and_their_covariances_honest(scanned, noise, most):
    """NEES of 200 matches: about 3 if the covariance is right, less if it is too large."""
    rng, room = np.random.default_rng(5), furnished_room()
    errors, nees = [], []
    for _ in range(200):
        pose = random_pose(room, rng)
        step = step_from(room, pose, rng)
        scans = scanned(room, pose, noise, rng), scanned(room, compose(pose, step), noise, rng)
        error, match = matched(*scans, step, noise, rng)
        errors.append(error)
        nees.append(squared(error, match.covariance))
    assert np.sqrt(np.mean(np.square(errors)[:, :2].sum(1))) < most
    assert np.mean(nees) < chi2.ppf(0.975, 3 * 200) / 200
    assert np.mean(nees) > 1.5
    assert np.mean(np.array(nees) < chi2.ppf(0.99, 3)) > 0.97


def test_along_a_corridor_a_match_claims_no_more_than_the_guess():
    """Errors of the normals look like information there; the covariance must not take it for any."""
    rng, corridor = np.random.default_rng(2), rectangular_room(120, 2.4)
    nees, alongs = [], []
    for _ in range(100):
        pose = np.array([rng.uniform(-5, 5), rng.uniform(-0.5, 0.5), rng.uniform(-np.pi, np.pi)])
        step = step_from(corridor, pose, rng)
        scans = [sick_scan(corridor, p, COARSE, rng) for p in (pose, compose(pose, step))]
        error, match = matched(*scans, step, COARSE, rng)
        nees.append(squared(error, match.covariance))
        across, along = np.sqrt(np.linalg.eigvalsh(match.covariance[:2, :2]))
        alongs.append(along)
        assert across < 0.02
    assert np.median(alongs) > 2 * np.sqrt(GUESS[0, 0])
    assert min(alongs) > 0.5 * np.sqrt(GUESS[0, 0])
    assert np.mean(nees) < chi2.ppf(0.975, 300) / 100


def test_the_search_finds_the_best_pose_of_its_window():
    """Against all poses of the window, scored one by one with nearest neighbours."""
    rng, room = np.random.default_rng(3), furnished_room()
    settings = MatchSettings(cell=0.1, blur=0.15)
    pose, step = np.array([4.5, 4.0, 0.4]), np.array([0.5, -0.3, 0.2])
    reference = sick_scan(room, pose, COARSE, rng).xy
    points = sick_scan(room, compose(pose, step), COARSE, rng).xy
    guess, sigma = step + np.array([0.21, -0.33, 0.11]), np.array([0.2, 0.2, 0.1])
    found = search(reference, points, guess, sigma, settings)
    turns = found[2] + (guess[2] - found[2]) * np.arange(-3, 4) / 3 if found[2] != guess[2] else [guess[2]]
    shifts = 0.1 * np.arange(-6, 7)
    best = max(
        _score(reference, points, guess + np.array([dx, dy, 0]), turn, guess, sigma, settings)
        for dx in shifts
        for dy in shifts
        for turn in turns
    )
    assert _score(reference, points, found, found[2], guess, sigma, settings) >= best - 1e-3


def _score(reference, points, pose, turn, guess, sigma, settings):
    """Score of a pose as `search` defines it: Gaussians at the centres of cells, less the guess's penalty."""
    c, s = np.cos(turn), np.sin(turn)
    low = reference.min(axis=0) - (3 * settings.blur + 8 * settings.cell)
    cells = np.floor((points @ np.array([[c, s], [-s, c]]) + pose[:2] - low) / settings.cell + 1e-9)
    distances, _ = cKDTree(reference).query(low + (cells + 0.5) * settings.cell)
    scores = np.exp(-((distances / settings.blur) ** 2) / 2) * (distances < 3 * settings.blur)
    off = (np.array([*pose[:2], turn]) - guess) / sigma
    return scores.sum() - off @ off / 2


def test_rows_of_pairs_are_the_derivatives_of_their_distances():
    rng, room = np.random.default_rng(4), furnished_room()
    settings = MatchSettings(noise=FINE)
    A, B = (surface(full_scan(room, p, FINE, rng), settings) for p in ([4.5, 4.0, 0.4], [4.7, 3.9, 0.5]))
    x = np.array([0.15, -0.2, 0.12])

    def rows(pose):
        pairs, table = np.full(len(B.bearings), -1), np.zeros((len(B.bearings), 5))
        pair(A, B, pose, 0.3, pairs, table)
        return pairs, table

    pairs, table = rows(x)
    used = pairs >= 0
    assert used.sum() > 500
    for k in range(3):
        offset = 1e-6 * np.eye(3)[k]
        (ahead, up), (behind, down) = rows(x + offset), rows(x - offset)
        same = used & (ahead == pairs) & (behind == pairs)
        assert same.sum() > 500
        np.testing.assert_allclose((up - down)[same, 3] / 2e-6, table[same, k], atol=1e-6)


def test_scans_of_different_places_have_few_points_in_common():
    rng = np.random.default_rng(6)
    here = full_scan(furnished_room(), np.array([4.5, 4.0, 0.0]), FINE, rng)
    there = full_scan(rectangular_room(3, 2), np.zeros(3), FINE, rng)
    match = match_scans(here, there, np.zeros(3), GUESS)
    assert match.inliers < LoopSettings().inliers
    assert match.conflicts > LoopSettings().conflicts


@pytest.mark.parametrize(
    "ranges", [np.full(180, np.nan), np.r_[np.full(179, np.nan), 3.0]], ids=["none", "one"]
)
def test_a_scan_without_surfaces_has_no_inliers_and_says_what_the_guess_says(ranges):
    rng, room = np.random.default_rng(7), furnished_room()
    blind = Scan(ranges, np.deg2rad(np.arange(-90.0, 90.0)))
    seeing = sick_scan(room, np.array([4.5, 4.0, 0.0]), COARSE, rng)
    for reference, scan in ((seeing, blind), (blind, seeing), (blind, blind)):
        match = match_scans(reference, scan, [0.1, 0.2, 0.3], GUESS)
        assert match.inliers < 0.01
        np.testing.assert_allclose(match.pose, [0.1, 0.2, 0.3], atol=0.05)
        np.testing.assert_allclose(match.covariance, 9 * GUESS, rtol=0.05, atol=1e-4)


@pytest.mark.parametrize(
    ("guess", "covariance", "told"),
    [
        ([0, 0], GUESS, "The guess is"),
        ([0, np.nan, 0], GUESS, "The guess is"),
        ([0, 0, 0], np.diag([1.0, 1.0, 0.0]), "singular"),
        ([0, 0, 0], np.diag([1.0, np.nan, 1.0]), "not finite"),
        ([0, 0, 0], np.eye(2), "shape"),
    ],
)
def test_bad_guesses_are_told(guess, covariance, told):
    scan = Scan(np.full(180, 2.0), np.deg2rad(np.arange(-90.0, 90.0)))
    with pytest.raises(LocalizationError, match=told):
        match_scans(scan, scan, guess, covariance)
