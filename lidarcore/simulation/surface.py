"""Walls as they are: plaster, panels and skirting boards make them uneven, in the same way in every scan."""

from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array, Ints

_STEP = 1e-3  # m between the points where a pattern is made
_FINE = 50  # such points in a correlation length, at least: between them the variance is lower by a hundredth at most


@dataclass(frozen=True, eq=False, slots=True)
class Surface:
    """How far (m) each wall's surface lies off its line, to the left of the way from its start to its end.

    An Ornstein-Uhlenbeck process along each wall: Gaussian, the covariance of two points is
    deviation² exp(-distance / length). From another bearing a beam samples it elsewhere, from the same one again.
    """

    offsets: Array
    first: Ints
    step: float

    @classmethod
    def of(cls, walls: Array, deviation: float, length: float, seed: int) -> "Surface":
        """The pattern of walls (W, 2, 2) m with a standard deviation and a correlation length (1/e), m.

        Equal walls, numbers and seeds have equal patterns; each wall has its own, whatever the others are.
        """
        step = min(_STEP, length / _FINE)
        extents = np.hypot(*(walls[:, 1] - walls[:, 0]).T)
        counts = np.ceil(extents / step).astype(np.int64) + 2
        first = np.cumsum(counts) - counts
        patterns = [
            _pattern(count, step / length, np.random.default_rng((seed, wall)))
            for wall, count in enumerate(counts.tolist())
        ]
        return cls(deviation * np.concatenate(patterns), first, step)

    def at(self, walls: Ints, along: Array) -> Array:
        """(N,) m, off the lines of walls (N,) at distances (N,) m from their starts."""
        at = along / self.step
        below = at.astype(np.int64)
        share = at - below
        index = self.first[walls] + below
        return (1 - share) * self.offsets[index] + share * self.offsets[index + 1]


def _pattern(count: int, step: float, rng: np.random.Generator) -> Array:
    """(count,) of an Ornstein-Uhlenbeck process of unit variance, at points `step` correlation lengths apart."""
    from scipy.signal import lfilter  # here: importing it takes a second

    kept = np.exp(-step)
    steps = np.sqrt(1 - kept**2) * rng.normal(size=count)
    steps[0] = rng.normal()
    return lfilter([1.0], [1.0, -kept], steps)
