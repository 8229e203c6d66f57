"""Round things: where beams meet them, and fields of them to drive through."""

from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import SimulationError

_TRIES = 10_000


@dataclass(frozen=True, eq=False, slots=True)
class Posts:
    """Upright round posts of one radius (m): centres (P, 2) m, world frame."""

    centres: Array
    radius: float

    def distances(self, positions: Array, directions: Array) -> Array:
        """Distance (N,) m to the nearest post from positions (N, 2) m along unit vectors (N, 2); inf for none."""
        return distances_to_circles(self.centres[:, None], self.radius, positions, directions)


def distances_to_circles(centres: Array, radius: float, positions: Array, directions: Array) -> Array:
    """Distance (N,) m from each beam's origin to the nearest circle it meets, inf for none.

    centres (L, N, 2) or (L, 1, 2), positions (N, 2) m, directions (N, 2) unit vectors, all in the world frame.
    """
    to_centre = centres - positions
    along = (to_centre * directions).sum(-1)
    aside = to_centre[..., 0] * directions[:, 1] - to_centre[..., 1] * directions[:, 0]
    half_chord = np.sqrt(np.maximum(radius**2 - aside**2, 0))
    meets = (half_chord > 0) & (along > half_chord)
    return np.where(meets, along - half_chord, np.inf).min(axis=0, initial=np.inf)


def scattered(
    rng: np.random.Generator,
    count: int,
    area: tuple[float, float, float, float],
    way: Array,
    *,
    radius: float = 0.1,
    clearance: float = 0.8,
    apart: float = 1.2,
) -> Posts:
    """Posts at random in an area (x from, x to, y from, y to; m), clear of a way (M, 2) and apart from each other.

    radius, clearance (from centre to way) and apart (between centres) in m.
    Raises SimulationError if so many do not fit.
    """
    low, high = np.array(area).reshape(2, 2).T
    centres = np.empty((0, 2))
    for _ in range(_TRIES):
        if len(centres) == count:
            return Posts(centres, radius)
        spot = rng.uniform(low, high)
        if _distance(spot, way) >= clearance and _distance(spot, centres) >= apart:
            centres = np.vstack([centres, spot])
    raise SimulationError(f"Only {len(centres)} of {count} posts fit into the area: ask for fewer.")


def _distance(spot: Array, points: Array) -> float:
    return float(np.hypot(*(points - spot).T).min(initial=np.inf))
