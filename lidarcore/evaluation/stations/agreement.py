"""Agreement: the same walls and corners from several places; do they differ by as much as is claimed?

Repeatability asks what scatters while nothing moves. Agreement asks for truth: a wall seen from another place is
another sample of its unevenness, and of whatever else a sensor does wrong in the same way in every scan from one place.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.evaluation.consistency.figures import GATES, LEVELS
from lidarcore.evaluation.repeatability.wall_tracker import shared_extents, unwrapped
from lidarcore.evaluation.stations.feature_set import FeatureSet, moved
from lidarcore.geometry import act, act_jacobians, squared_mahalanobis

_STEPS = 5
_ROBUST = 4.0  # Mahalanobis distance from which on a wall counts less for the pose
_HARDLY = np.diag([0.3**-2, 0.3**-2, 0.1**-2])  # information on a pose that no wall tells, m and rad
_TOLD = 3.0  # times what is claimed of a wall: so well, at least, the others must tell where it is
_CORNER_GATE = 0.15  # m between the same corner from two places
_MOST = 0.1  # m, of a systematic part that is looked for
_HALVINGS = 16  # to a micrometre or two


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Features of two scans of the same walls, and roughly the relative pose of the scans: T_first_second (3,)."""

    first: FeatureSet
    second: FeatureSet
    pose: Array


@dataclass(frozen=True, slots=True, eq=False)
class Differences:
    """Squared Mahalanobis distances, chi-square with 2 degrees of freedom if the claims are true: of walls, corners."""

    walls: Array
    corners: Array


def differences(pair: Pair, sigma: float = 0.0) -> Differences:
    """How far each wall and corner is from where the others say it is; sigma (m) of a systematic part is added.

    The relative pose comes from the walls themselves. A wall is therefore held against the pose that the other walls
    tell, a corner against that of the walls it is not made of, and what is not known of that pose is part of the
    claim: the pose takes no degree of freedom away unseen. What the others do not tell well enough is left out, as
    claims without a systematic part have it, so that the same differences are judged whatever sigma is.
    """
    registered = _RegisteredPair.of(pair)
    return Differences(registered.walls(sigma), registered.corners(sigma))


def systematic_part(groups: Sequence[Sequence[Pair]]) -> float:
    """The systematic part (m) with which 95 % ellipses hold 95 % of the differences of walls.

    groups: pairs of scans from the same two places each; every group counts the same.
    """
    registered = [[_RegisteredPair.of(pair) for pair in group] for group in groups]
    low, high = 0.0, _MOST
    if _coverage(registered, low) >= 0.95:
        return low
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if _coverage(registered, middle) >= 0.95 else (middle, high)
    return high


def coverage(groups: Sequence[Sequence[Pair]], sigma: float) -> float:
    """Share of the walls' differences in the 95 % ellipses, with a systematic part of sigma m."""
    return _coverage([[_RegisteredPair.of(pair) for pair in group] for group in groups], sigma)


@dataclass(frozen=True, slots=True, eq=False)
class _RegisteredPair:
    """A pair at the relative pose that its walls tell; which walls (N, 2) match, and which of them the others tell."""

    pair: Pair
    matches: Ints
    told: list[int]

    @classmethod
    def of(cls, pair: Pair) -> "_RegisteredPair":
        pose, matches = _registered(pair)
        walls = _Walls.at(pair, matches, pose)
        told = [i for i in range(len(matches)) if walls.is_told(i)]
        return cls(Pair(pair.first, pair.second, pose), matches, told)

    def walls(self, sigma: float) -> Array:
        """Squared Mahalanobis distances of the walls with a systematic part of sigma m."""
        walls = _Walls.at(self._claimed(sigma), self.matches, self.pair.pose)
        return np.array([walls.distance(i) for i in self.told])

    def corners(self, sigma: float) -> Array:
        """Squared Mahalanobis distances of the corners with a systematic part of sigma m."""
        claimed = self._claimed(sigma)
        walls = _Walls.at(claimed, self.matches, self.pair.pose)
        found = (_corner_distance(claimed, walls, self.matches, k) for k in range(len(claimed.first.corners)))
        return np.array([distance for distance in found if distance is not None])

    def _claimed(self, sigma: float) -> Pair:
        first, second = (features.with_systematic(sigma) for features in (self.pair.first, self.pair.second))
        return Pair(first, second, self.pair.pose)


def _coverage(groups: Sequence[Sequence[_RegisteredPair]], sigma: float) -> float:
    held = [np.concatenate([registered.walls(sigma) for registered in group]) <= GATE for group in groups]
    return float(np.mean([share.mean() for share in held if len(share)]))


@dataclass(frozen=True, slots=True, eq=False)
class _Walls:
    """Walls seen twice: first less second (N, 2), Jacobians (N, 2, 3) by the pose, covariances (N, 2, 2)."""

    e: Array
    J: Array
    V: Array

    @classmethod
    def at(cls, pair: Pair, matches: Ints, pose: Array) -> "_Walls":
        """The matched walls (N, 2), those of the second scan moved by T_first_second (3,)."""
        a, b = matches.T
        there, J, F = moved(pair.second.lines[b], pose)
        here = np.column_stack(unwrapped(pair.first.lines[a], there[:, 0]))
        V = pair.first.covariances[a] + F @ pair.second.covariances[b] @ F.swapaxes(1, 2)
        return cls(here - there, J, V)

    def correction(self, of: Bools, weights: Array | None = None) -> tuple[Array, Array]:
        """What some of the walls correct the pose by (3,), and its covariance; hardly known where they do not tell."""
        information = np.linalg.inv(self.V[of]) * (1.0 if weights is None else weights[of, None, None])
        weighted = self.J[of].swapaxes(1, 2) @ information
        P = np.linalg.inv((weighted @ self.J[of]).sum(0) + _HARDLY)
        return P @ (weighted @ self.e[of][..., None]).sum(0)[:, 0], P

    def but(self, i: int) -> Bools:
        """All walls but this one."""
        return np.arange(len(self.e)) != i

    def is_told(self, i: int) -> bool:
        """Whether the others tell where this wall is, about as well as it is seen itself."""
        _, P = self.correction(self.but(i))
        told = np.linalg.solve(self.V[i], self.J[i] @ P @ self.J[i].T)
        return bool(np.linalg.eigvals(told).real.max() < _TOLD**2)

    def distance(self, i: int) -> float:
        """Squared Mahalanobis distance of a wall from where the others say it is."""
        step, P = self.correction(self.but(i))
        return float(
            squared_mahalanobis(self.e[i] - self.J[i] @ step, self.V[i] + self.J[i] @ P @ self.J[i].T)
        )


GATE = float(GATES[LEVELS.index(0.95)])


def _matches(pair: Pair) -> Ints:
    """(N, 2) numbers of walls that are the same in both, those that share most of their extent first, each once."""
    first, second = pair.first, pair.second
    known = np.array([_extent(line, ends) for line, ends in zip(first.lines, first.ends, strict=True)])
    lines = moved(second.lines, pair.pose)[0]
    pieces = np.column_stack([lines, act(pair.pose, second.ends).reshape(-1, 4)])
    shares = shared_extents(pieces, known.reshape(-1, 4), 0.0)
    found: list[tuple[int, int]] = []
    for b, a in np.argwhere(shares > 0)[np.argsort(-shares[shares > 0])].tolist():
        if all(a != one and b != other for one, other in found):
            found.append((a, b))
    return np.array(found, np.int64).reshape(-1, 2)


def _extent(line: Array, ends: Array) -> tuple[float, float, float, float]:
    """alpha, r, from where to where along the wall."""
    low, high = np.sort(ends @ [-np.sin(line[0]), np.cos(line[0])]).tolist()
    return float(line[0]), float(line[1]), low, high


def _registered(pair: Pair) -> tuple[Array, Ints]:
    """T_first_second (3,) by least squares of the walls, and the matches that hold at it."""
    pose, matches = pair.pose, _matches(pair)
    for _ in range(_STEPS):
        walls = _Walls.at(pair, matches, pose)
        far = np.sqrt(np.maximum(squared_mahalanobis(walls.e, walls.V), 1e-12))
        step, _ = walls.correction(np.ones(len(matches), bool), np.minimum(1.0, _ROBUST / far))
        pose = pose + step
        matches = _matches(Pair(pair.first, pair.second, pose))
    return pose, matches


def _corner_distance(pair: Pair, walls: _Walls, matches: Ints, k: int) -> float | None:
    """Squared Mahalanobis distance of corner k of the first scan from where the second scan and the pose have it.

    None where the second scan has none there, or the walls do not tell it.
    """
    step, P = walls.correction(~np.isin(matches[:, 0], pair.first.walls[k]))
    pose = pair.pose + step
    if not len(pair.second.corners):
        return None
    off = pair.first.corners[k] - act(pose, pair.second.corners)
    nearest = int(np.argmin(np.hypot(*off.T)))
    by_pose, by_point = act_jacobians(pose, pair.second.corners[nearest])
    C = pair.first.corner_covariances[k] + by_point @ pair.second.corner_covariances[nearest] @ by_point.T
    predicted = by_pose @ P @ by_pose.T
    told = np.linalg.eigvals(np.linalg.solve(C, predicted)).real.max() < _TOLD**2
    if np.hypot(*off[nearest]) > _CORNER_GATE or not told:
        return None
    return float(squared_mahalanobis(off[nearest], C + predicted))
