"""What the SLAM filter remembers of its landmarks beside their positions, and which of them are one thing."""

import numpy as np
from numpy.typing import NDArray

from lidarcore.arrays import Array, Bools, Ints
from lidarcore.geometry import chi_square_gate, squared_mahalanobis
from lidarcore.localization.ekf.association import Association
from lidarcore.localization.ekf.joint import JointState
from lidarcore.localization.ekf.map_kernels import near_pairs
from lidarcore.localization.landmarks import Landmarks
from lidarcore.localization.settings import LocalizationSettings
from lidarcore.localization.visibility import Costs

_SECTORS = 64  # directions from which a landmark may have been seen, 5.6 degrees each
_FORGOTTEN = 3.0  # s without a sighting, after which a tentative landmark is dropped
_ENOUGH = 3  # landmarks, below which their share says nothing
_SHARE = 0.25  # of the landmarks that a scan could show: fewer would be chance


class Register:
    """Ids, kinds, sightings and trust of L landmarks.

    Trust grows by one with each sighting, up to a limit, and falls with each view of the place without it: below
    zero the landmark is not there. Views count only from where it was seen before, as near or nearer: from most
    directions the corner of a box is none. It is confirmed once trust and the time since its first sighting suffice.
    """

    def __init__(self, settings: LocalizationSettings) -> None:
        self._confirm, self._settle = settings.confirm, settings.settle
        self._most = max(settings.memory, settings.confirm)
        self._next = 0
        self.possible = self.recognised = 0  # confirmed ones that the last scan could have shown, and did
        self.ids: Ints = np.empty(0, np.int64)
        self.kinds: NDArray[np.str_] = np.empty(0, np.str_)
        self.confirmed: Bools = np.empty(0, np.bool_)
        self.counts: Ints = np.empty(0, np.int64)
        self.first_seen: Array = np.empty(0)
        self.last_seen: Array = np.empty(0)
        self._trust: Array = np.empty(0)
        # m, largest distance at which each was seen in each direction; NaN if unknown
        self._seen_from: Array = np.empty((0, _SECTORS))

    def add(self, kinds: NDArray[np.str_], stamp: float) -> None:
        """Append landmarks of these kinds (K,), first seen at the stamp (s)."""
        K = len(kinds)
        new = {
            "ids": np.arange(self._next, self._next + K),
            "kinds": kinds,
            "confirmed": np.zeros(K, np.bool_),
            "counts": np.ones(K, np.int64),
            "first_seen": np.full(K, stamp),
            "last_seen": np.full(K, stamp),
            "_trust": np.ones(K),
            "_seen_from": np.zeros((K, _SECTORS)),
        }
        for name, values in new.items():
            setattr(self, name, np.concatenate([getattr(self, name), values]))
        self._next += K

    def add_known(self, landmarks: Landmarks) -> None:
        """Append the landmarks of a map with their ids; those that are confirmed are trusted as far as any."""
        self.add(np.asarray(landmarks.points.kinds), 0.0)
        K = len(landmarks)
        for name in ("ids", "confirmed", "counts", "first_seen", "last_seen"):
            getattr(self, name)[-K:] = getattr(landmarks, name)
        self._seen_from[-K:] = np.nan
        self._trust[-K:] = np.where(landmarks.confirmed, self._most, 1)
        self._next = int(landmarks.ids.max()) + 1

    @property
    def is_at_odds(self) -> bool:
        """The last scan did not show what it should have, but other things: the sensor is not where it seems to be."""
        return is_at_odds(self.possible, self.recognised)

    def count(
        self, association: Association, observed: int, stamp: float, costs: Costs, views: Array
    ) -> Bools:
        """Count a scan of so many observations at the stamp (s); (L,) true for the landmarks that are to be kept.

        views (L, 2) m, world frame, lead from each landmark to the sensor. Costs say what trust is lost by those
        that were not seen; what an ambiguous pair may have shown is not missed.
        """
        seen = np.concatenate([association.landmark, association.tentative[:, 1]])
        distances, directions = np.hypot(*views.T), np.arctan2(views[:, 1], views[:, 0]) / (2 * np.pi)
        here = np.arange(len(views)), np.floor(_SECTORS * directions).astype(np.int64) % _SECTORS
        farthest = self._seen_from[here]
        self._seen_from[seen, here[1][seen]] = np.fmax(farthest, distances)[seen]
        self._recognise(seen, observed, (costs.unseen > 0) & ~(distances > farthest))
        missed = np.maximum(costs.absent, costs.unseen * (distances <= farthest))
        missed[seen] = missed[association.ambiguous[:, 1]] = missed[association.incompatible[:, 1]] = 0.0
        if not self.is_at_odds:
            self._trust -= missed
        self._trust[seen] += 1
        self._trust = np.minimum(self._trust, self._most)
        self.counts[seen] += 1
        self.last_seen[seen] = stamp
        self.first_seen = np.minimum(self.first_seen, self.last_seen)  # the clock may have gone back
        settled = self.last_seen - self.first_seen >= self._settle
        self.confirmed = self.confirmed | ((self._trust >= self._confirm) & settled)
        fresh = stamp - self.last_seen <= _FORGOTTEN
        kept: Bools = (self._trust >= 0) & (self.confirmed | fresh)
        return kept

    def _recognise(self, seen: Ints, observed: int, expected: Bools) -> None:
        expected[seen] = True
        self.possible = min(int((expected & self.confirmed).sum()), observed)
        self.recognised = int(self.confirmed[seen].sum())

    def merge(self, kept: int, dropped: int) -> None:
        """Add what is known of one landmark to another, which is the same; `keep` has to follow."""
        self.counts[kept] += self.counts[dropped]
        self.first_seen[kept] = min(self.first_seen[kept], self.first_seen[dropped])
        self.last_seen[kept] = max(self.last_seen[kept], self.last_seen[dropped])
        self._trust[kept] = max(self._trust[kept], self._trust[dropped])
        self._seen_from[kept] = np.fmax(self._seen_from[kept], self._seen_from[dropped])

    def keep(self, kept: Bools) -> None:
        """Forget the landmarks that are not in kept (L,)."""
        for name in (
            "ids",
            "kinds",
            "confirmed",
            "counts",
            "first_seen",
            "last_seen",
            "_trust",
            "_seen_from",
        ):
            setattr(self, name, getattr(self, name)[kept])


def is_at_odds(possible: int, recognised: int) -> bool:
    """True if so few of the landmarks that a scan could show were recognised that the pose must be wrong."""
    return possible >= _ENOUGH and recognised < _SHARE * possible


_APART = 0.3  # m; what lies farther apart is not merged for the uncertainty of its position alone


def find_duplicate(
    joint: JointState,
    kinds: NDArray[np.str_],
    confirmed: Bools,
    seen: Bools,
    settings: LocalizationSettings,
) -> tuple[int, int] | None:
    """Two confirmed landmarks so near, given their joint covariance, that neither is new beside the other, or None.

    They are of one kind, and only the first was seen (L,) in this scan: what is seen beside it is another thing.
    """
    gate, error = chi_square_gate(settings.new_gate), 2 * settings.unevenness**2 * np.eye(2)
    first, second = np.flatnonzero(confirmed & seen), np.flatnonzero(confirmed & ~seen)
    for a, b in near_pairs(joint.landmarks, first, second, _APART):
        if kinds[a] != kinds[b]:
            continue
        z, S = _difference(joint, a, b)
        if squared_mahalanobis(z, S + error) < gate:
            return a, b
    return None


def _difference(joint: JointState, a: int, b: int) -> tuple[Array, Array]:
    """Where landmark a is as seen from b (2,), with its covariance (2, 2), along the axes of the sensor."""
    z, S = joint.jointly_expected(np.array([a, b]), np.zeros((2, 2, 2)))
    return z[0] - z[1], S[:2, :2] + S[2:, 2:] - S[:2, 2:] - S[2:, :2]
