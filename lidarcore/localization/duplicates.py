"""Which landmarks of a map are one and the same thing."""

import numpy as np
from numpy.typing import NDArray

from lidarcore.localization.association import gate_of, squared_distances
from lidarcore.localization.joint import JointState
from lidarcore.localization.kernels import near_pairs
from lidarcore.localization.settings import LocalizationSettings
from lidarcore.scan import Array

_APART = 0.3  # m; what lies farther apart is not merged for the uncertainty of its position alone


def find_duplicate(
    joint: JointState,
    kinds: NDArray[np.str_],
    confirmed: NDArray[np.bool_],
    seen: NDArray[np.bool_],
    settings: LocalizationSettings,
) -> tuple[int, int] | None:
    """Two confirmed landmarks so near, given their joint covariance, that neither is new beside the other, or None.

    They are of one kind, and only the first was seen (L,) in this scan: what is seen beside it is another thing.
    """
    gate, error = gate_of(settings.new_gate), 2 * settings.unevenness**2 * np.eye(2)
    first, second = np.flatnonzero(confirmed & seen), np.flatnonzero(confirmed & ~seen)
    for a, b in near_pairs(joint.landmarks, first, second, _APART):
        if kinds[a] != kinds[b]:
            continue
        z, S = _difference(joint, a, b)
        if squared_distances(z, S + error) < gate:
            return a, b
    return None


def _difference(joint: JointState, a: int, b: int) -> tuple[Array, Array]:
    """Where landmark a is as seen from b (2,), with its covariance (2, 2), along the axes of the sensor."""
    z, S = joint.jointly_expected(np.array([a, b]), np.zeros((2, 2, 2)))
    return z[0] - z[1], S[:2, :2] + S[2:, 2:] - S[:2, 2:] - S[2:, :2]
