"""The surfaces of the last keyframes, and where a scan lies on them."""

from collections import deque
from itertools import islice

import numpy as np

from lidarcore.arrays import Array
from lidarcore.geometry import UncertainPose, compose, pose_difference, relative
from lidarcore.mapping.doubt import DOUBTFUL, evidence, loss
from lidarcore.mapping.matching.correlative import arm, candidates, search
from lidarcore.mapping.matching.patches import Patches, joined, placed
from lidarcore.mapping.matching.registration import Registration, information_of, register
from lidarcore.mapping.matching.sight import conflicts, sight
from lidarcore.mapping.matching.surfels import Surfels, surfels
from lidarcore.mapping.settings import FrontSettings
from lidarcore.scan import Scan

BLIND = 20  # patches: a scan that has fewer fits anywhere
SURE = 0.6  # share of a scan on the map from which on it needs no search
_FURTHER = 3.0  # times as far is looked for a scan that does not fit
_TURNED = 0.25  # rad from which on two poses are not the same
_WIDE = 0.5  # m by which a point may be off where the search is needed in any case
_BETTER = 0.02  # share of a scan by which a pose that was searched for must be better than that of the guess
_RIVAL = 0.85  # of the share of a scan on the map, from which on another pose is a rival
_RIVALS = 8  # other poses that are looked at


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

    def registered(self, scan: Scan, seen: Patches, guess: UncertainPose) -> Registration:
        """The scan on the local map: from the guess on, and after a search where the guess is vague or does not fit.

        Of a scan that lies on the map nearly whole no search could tell a pose that is better by as much as it must be.
        What a search finds far from the guess must be told by something that was seen against the guess: where a sensor
        comes to what it has not seen yet, a corridor fits best where it has been seen.
        """
        match, (x, P) = self._settings.match, UncertainPose(self._anchor, np.zeros((3, 3))).compose(guess)
        prior = information_of(P)
        sigma = np.sqrt(np.diagonal(P))
        near = seen.near.means
        registered = at_guess = register(self._surfels, seen, x, x, prior, match.reach)
        if len(near) < BLIND:
            return registered
        if registered.inliers < SURE or (_is_vague(sigma, near) and registered.inliers + _BETTER < 1):
            registered = self._searched(seen, x, sigma, prior, registered)
        if registered.inliers < SURE:
            registered = self._searched(seen, x, _FURTHER * sigma, prior, registered)
        is_far = _apart(registered.pose, x) and _contradiction(registered, x, prior) > DOUBTFUL
        if is_far and not self._refutes(scan, at_guess.pose, registered.pose, len(near)):
            return at_guess
        return registered

    def registered_again(self, seen: Patches, guess: UncertainPose, pose: Array) -> Registration:
        """The scan on the local map, from a pose near the right one."""
        x, P = UncertainPose(self._anchor, np.zeros((3, 3))).compose(guess)
        return register(self._surfels, seen, pose, x, information_of(P), self._settings.match.reach)

    def _searched(
        self, seen: Patches, x: Array, sigma: Array, prior: Array, registered: Registration
    ) -> Registration:
        """The better one of where the scan was registered and where a search finds it."""
        match = self._settings.match
        reference, near = self._surfels.means[self._surfels.near], seen.near.means
        start = search(reference, near, x, sigma, match)
        other = register(self._surfels, seen, start, x, prior, match.reach)
        n = len(near)
        better = _worth(other, n, x, prior) > _worth(registered, n, x, prior) + _BETTER * n
        return other if better else registered

    def rival(self, seen: Patches, guess: UncertainPose, registered: Registration) -> Array | None:
        """Another pose (3,) at which a scan that fits badly fits nearly as well, if the guess leaves it open."""
        reference, near = self._surfels.means[self._surfels.near], seen.near.means
        if not self._settings.inliers <= registered.inliers < SURE or len(near) < BLIND:
            return None
        match, (x, P) = self._settings.match, UncertainPose(self._anchor, np.zeros((3, 3))).compose(guess)
        sigma, prior, besides = np.sqrt(np.diagonal(P)), information_of(P), registered.pose[None]
        if 3 * np.hypot(sigma[0], sigma[1]) < _WIDE:
            return None
        for start in islice(candidates(reference, near, x, sigma, match, besides), _RIVALS):
            other = register(self._surfels, seen, start, x, prior, match.reach)
            if other.inliers >= _RIVAL * registered.inliers and _apart(registered.pose, other.pose):
                return other.pose
        return None

    def scatter(self, seen: Patches, guess: UncertainPose, registered: Registration) -> Array:
        """(3, 3) of how far from where it was registered a scan fits as well, or worse only by chance.

        A scan of few beams that shows much new fits in several ways, some degrees apart: registered from either side,
        as far as the guess leaves its heading open, it comes to lie elsewhere. What lies farther apart is another
        place: a corridor looks the same both ways.
        """
        match, (x, P) = self._settings.match, UncertainPose(self._anchor, np.zeros((3, 3))).compose(guess)
        sigma, prior, near = np.sqrt(np.diagonal(P)), information_of(P), seen.near.means
        spread, total = np.zeros((3, 3)), 1.0
        if len(near) < BLIND or not _is_vague(sigma, near) or registered.inliers + _BETTER >= 1:
            return spread
        turned = min(sigma[2], _TURNED)
        for turn in (-turned, turned):
            start = registered.pose + np.array([0.0, 0.0, turn])
            other = register(self._surfels, seen, start, x, prior, match.reach)
            off = pose_difference(other.pose, registered.pose)
            if off @ registered.information @ off > 1:
                likelihood = _likelihood(other, registered, x, prior, len(near))
                spread += likelihood * np.outer(off, off)
                total += likelihood
        return spread / total

    def is_chance(self, seen: Patches, guess: UncertainPose, registered: Registration) -> bool:
        """Whether a scan that contradicts the guess fits no better than that costs: some of it fits anywhere."""
        x, P = UncertainPose(self._anchor, np.zeros((3, 3))).compose(guess)
        prior = information_of(P)
        worth = evidence(registered.inliers, len(seen.near.means))
        return _contradiction(registered, x, prior) > DOUBTFUL and worth < _cost(registered, x, prior) / 2

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


def _is_vague(sigma: Array, near: Array) -> bool:
    """Whether a guess with standard deviations (3,) may put points (N, 2) of a scan far from where they are."""
    far = arm(near) if len(near) else 0.0
    return bool(3 * (np.hypot(sigma[0], sigma[1]) + far * sigma[2]) > _WIDE)


def _likelihood(other: Registration, best: Registration, guess: Array, prior: Array, n: int) -> float:
    """Of another pose of n patches, if it fits worse than the best one by chance: beside 1 for the best one."""
    less = max(best.inliers - other.inliers, 0.0)
    variance = (2 - best.inliers - other.inliers) / n  # of two shares
    farther = max(_cost(other, guess, prior) - _cost(best, guess, prior), 0.0)
    return float(np.exp(-(less**2 / variance + farther) / 2))


def _worth(registered: Registration, n: int, guess: Array, prior: Array) -> float:
    """Log-likelihood of a pose: a patch of the n for each that fits, as in the search, less how far the guess is."""
    return n * registered.inliers - _cost(registered, guess, prior) / 2


def _cost(registered: Registration, guess: Array, prior: Array) -> float:
    """What it costs that a pose contradicts the guess (3,)."""
    return float(loss(_contradiction(registered, guess, prior), DOUBTFUL))


def _contradiction(registered: Registration, guess: Array, prior: Array) -> float:
    """Squared Mahalanobis distance of a pose from the guess (3,), which has the information prior (3, 3)."""
    off = pose_difference(registered.pose, guess)
    return float(off @ prior @ off)


def _apart(a: Array, b: Array) -> bool:
    """Whether two poses (3,) are not the same."""
    x, y, turn = pose_difference(a, b)
    return bool(np.hypot(x, y) > _WIDE or abs(turn) > _TURNED)
