"""What the SLAM filter remembers of its landmarks beside their positions."""

import numpy as np
from numpy.typing import NDArray

from lidarcore.localization.association import Association
from lidarcore.localization.settings import LocalizationSettings
from lidarcore.scan import Ints


class Register:
    """Ids, kinds and trust of L landmarks.

    Trust grows by one with each sighting, up to a limit, and falls by one with each view of the place without it:
    below zero the landmark is not there. It is confirmed once trust has reached a number.
    """

    def __init__(self, settings: LocalizationSettings) -> None:
        self._confirm, self._most = settings.confirm, max(settings.memory, settings.confirm)
        self._next = 0
        self.ids: Ints = np.empty(0, np.int64)
        self.kinds: NDArray[np.str_] = np.empty(0, np.str_)
        self.confirmed: NDArray[np.bool_] = np.empty(0, np.bool_)
        self._trust: Ints = np.empty(0, np.int64)

    def add(self, kinds: NDArray[np.str_]) -> None:
        """Append landmarks of these kinds (K,), seen once."""
        K = len(kinds)
        self.ids = np.concatenate([self.ids, np.arange(self._next, self._next + K)])
        self.kinds = np.concatenate([self.kinds, kinds])
        self._trust = np.concatenate([self._trust, np.ones(K, np.int64)])
        self.confirmed = np.concatenate([self.confirmed, np.full(K, self._confirm <= 1)])
        self._next += K

    def count(self, association: Association, visible: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Count one scan, given which landmarks (L,) should be seen; forget those that are not there.

        Returns (L,) true for the landmarks that are kept. What an ambiguous pair may have shown is not missed.
        """
        missed = visible.copy()
        missed[association.landmark] = False
        missed[association.ambiguous[:, 1]] = missed[association.incompatible[:, 1]] = False
        self._trust[association.landmark] += 1
        self._trust = np.minimum(self._trust - missed, self._most)
        self.confirmed = self.confirmed | (self._trust >= self._confirm)
        kept: NDArray[np.bool_] = self._trust >= 0
        self.ids, self.kinds = self.ids[kept], self.kinds[kept]
        self._trust, self.confirmed = self._trust[kept], self.confirmed[kept]
        return kept
