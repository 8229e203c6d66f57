"""The surfaces of the last keyframes, and where a scan lies on them."""

from collections import deque
from itertools import islice

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import UncertainPose, compose, pose_difference, relative
from lidarcore.mapping.doubt import DOUBTFUL, evidence
from lidarcore.mapping.matching.correlative import candidates, search
from lidarcore.mapping.matching.expectation import Expectation, expectation
from lidarcore.mapping.matching.patches import Patches, joined, placed
from lidarcore.mapping.matching.registration import Registration, information_of, register
from lidarcore.mapping.matching.sight import conflicts, sight
from lidarcore.mapping.matching.surfels import Surfels, surfels
from lidarcore.mapping.settings import FrontSettings
from lidarcore.scan import Scan

_BLIND = 20  # patches: a scan that has fewer fits anywhere
SURE = 0.6  # share of a scan on the map from which on it needs no search
_FURTHER = 3.0  # times as far is looked for a scan that does not fit
_APART, _TURNED = 0.5, 0.25  # m and rad from which on two poses are not the same
_BETTER = 0.02  # share of a scan by which a pose that was searched for must be better than that of the guess
_RIVAL = 0.85  # of the share of a scan on the map, from which on another pose is a rival
_OPEN = 0.3  # likelihood beside 1 of the best pose, from which on another one is its rival, too
_RIVALS = 8  # other poses that are looked at
_ROUGHLY = 0.5  # of the share of a scan on the map, that fits another pose in the cells of a search, at least


class LocalMap:
    """A map in a local frame, which loops never bend; guesses and ties are poses from the newest keyframe."""

    def __init__(self, settings: FrontSettings) -> None:
        self._settings = settings
        self._window: deque[Patches] = deque(maxlen=settings.keyframes)  # in the local frame
        self._scans: deque[tuple[Array, Scan]] = deque(
            maxlen=settings.keyframes
        )  # T_local_scan, each with its scan
        self._surfels: Surfels  # of the window
        self._anchor = np.zeros(3)  # T_local_keyframe of the newest

    def clear(self) -> None:
        """Forget all keyframes, but not where the last one was."""
        self._window.clear()
        self._scans.clear()

    def add(self, scan: Scan, seen: Patches, tie: Array | None = None) -> None:
        """A keyframe at a pose (3,) from the one before it, or where that is: the map is made anew."""
        if tie is not None:
            self._anchor = compose(self._anchor, tie)
        self._window.append(placed(seen, self._anchor))
        self._scans.append((self._anchor, scan))
        self._surfels = surfels(joined(self._window), self._settings.match.patch, self._settings.match.reach)

    def expects(self, guess: UncertainPose) -> Expectation:
        """Where a scan should lie by a guess that is seen from the newest keyframe."""
        return expectation(UncertainPose(self._anchor, np.zeros((3, 3))).compose(guess))

    def registered(self, scan: Scan, seen: Patches, expected: Expectation) -> Registration:
        """The scan on the local map: from the guess on, and after a search where that is vague or does not fit.

        Of a scan that lies on the map nearly whole no search could tell a pose that is better by as much as it must be.
        What a search finds far from the guess must be told by something that was seen against the guess: where a sensor
        comes to what it has not seen yet, a corridor fits best where it has been seen.
        """
        registered = at_guess = self.registered_from(expected.pose, seen, expected)
        if is_blind(seen):
            return registered
        if registered.inliers < SURE or (
            registered.inliers + _BETTER < 1 and expected.leaves_open(seen.near_means)
        ):
            registered = self._searched(seen, expected, expected.sigma, registered)
        if registered.inliers < SURE:
            registered = self._searched(seen, expected, _FURTHER * expected.sigma, registered)
        is_far = _apart(registered.pose, expected.pose) and expected.contradiction(registered.pose) > DOUBTFUL
        if is_far and not self._refutes(scan, at_guess.pose, registered.pose, seen.near_count):
            return at_guess
        return registered

    def registered_from(
        self, start: Array, seen: Patches, expected: Expectation, settled: bool = False
    ) -> Registration:
        """The scan on the local map, from a pose (3,) in its frame that is near the right one, or nearly right."""
        reach = self._settings.match.reach
        return register(self._surfels, seen, start, expected.pose, expected.information, reach, settled)

    def _searched(
        self, seen: Patches, expected: Expectation, sigma: Array, registered: Registration
    ) -> Registration:
        """The better one of where the scan was registered and where a search up to sigma (3,) finds it."""
        reference, near = self._surfels.means[self._surfels.near], seen.near_means
        start = search(reference, near, expected.pose, sigma, self._settings.match)
        other, n = self.registered_from(start, seen, expected), len(near)
        better = expected.worth(other, n) > expected.worth(registered, n) + _BETTER * n
        return other if better else registered

    def rival(
        self, scan: Scan, seen: Patches, expected: Expectation, registered: Registration
    ) -> Array | None:
        """Another pose (3,) at which a scan fits nearly as well, if the guess and what was seen leave it open."""
        if registered.inliers < self._settings.inliers or is_blind(seen):
            return None
        if 3 * np.hypot(*expected.sigma[:2]) < _APART:
            return None
        reference, near = self._surfels.means[self._surfels.near], seen.near_means
        match, besides = self._settings.match, registered.pose[None]
        least = _ROUGHLY * registered.inliers
        others = candidates(reference, near, expected.pose, expected.sigma, match, besides, least)
        for start in islice(others, _RIVALS):
            other = self.registered_from(start, seen, expected)
            if self._is_open(other, registered, expected, len(near)) and not self._refutes(
                scan, other.pose, registered.pose, len(near)
            ):
                return other.pose
        return None

    @staticmethod
    def _is_open(other: Registration, best: Registration, expected: Expectation, count: int) -> bool:
        """Whether a scan of so many patches fits another pose so well that it may have been taken there."""
        if other.inliers < _RIVAL * best.inliers or not _apart(best.pose, other.pose):
            return False
        return best.inliers < SURE or expected.likelihood(other, best, count) > _OPEN

    def scatter(self, seen: Patches, expected: Expectation, registered: Registration) -> Array:
        """(3, 3) of how far from where it was registered a scan fits as well, or worse only by chance.

        A scan of few beams that shows much new fits in several ways, some degrees apart: registered from either side,
        as far as the guess leaves its heading open, it comes to lie elsewhere. What lies farther apart is another
        place: a corridor looks the same both ways.
        """
        spread, total = np.zeros((3, 3)), 1.0
        if is_blind(seen) or registered.inliers + _BETTER >= 1 or not expected.leaves_open(seen.near_means):
            return spread
        turned = min(expected.sigma[2], _TURNED)
        for turn in (-turned, turned):
            other = self.registered_from(registered.pose + np.array([0.0, 0.0, turn]), seen, expected)
            off = pose_difference(other.pose, registered.pose)
            if off @ registered.information @ off > 1:
                likelihood = expected.likelihood(other, registered, seen.near_count)
                spread += likelihood * np.outer(off, off)
                total += likelihood
        return spread / total

    def is_chance(self, seen: Patches, expected: Expectation, registered: Registration) -> bool:
        """Whether a scan that contradicts the guess fits no better than that costs: some of it fits anywhere."""
        if expected.contradiction(registered.pose) <= DOUBTFUL:
            return False
        return evidence(registered.inliers, seen.near_count) < expected.cost(registered.pose) / 2

    def _refutes(self, scan: Scan, pose: Array, other: Array, count: int) -> bool:
        """Whether more of a scan contradicts a pose (3,) than another one, by more than two standard deviations.

        A share is as uncertain as that of so many patches: beams that meet the same surface say the same.
        """
        at, there = (self._conflicts(scan, x) for x in (pose, other))
        return at - there > 2 * float(np.sqrt((at + there) / count))

    def _conflicts(self, scan: Scan, pose: Array) -> float:
        """Largest share that contradicts a keyframe, if the scan was taken at a pose (3,)."""
        view = sight(scan)
        return max(conflicts(sight(other), view, relative(at, pose)) for at, other in self._scans)

    def either(self, registered: Registration, rival: Array) -> UncertainPose:
        """The pose seen from the keyframe, so uncertain that it may be the rival."""
        pose, P = self.tie(registered)
        off = pose_difference(relative(self._anchor, rival), pose)
        return UncertainPose(pose, P + np.outer(off, off) + np.diag(off**2))

    def tie(self, registered: Registration) -> UncertainPose:
        """The pose seen from the keyframe."""
        exact = UncertainPose(self._anchor, np.zeros((3, 3)))
        return exact.relative(UncertainPose(registered.pose, information_of(registered.information)))


def is_blind(seen: Patches) -> bool:
    """Whether a scan has so few patches that it fits anywhere."""
    return seen.near_count < _BLIND


def _apart(a: Array, b: Array) -> bool:
    """Whether two poses (3,) are not the same."""
    x, y, turn = pose_difference(a, b)
    return bool(np.hypot(x, y) > _APART or abs(turn) > _TURNED)
