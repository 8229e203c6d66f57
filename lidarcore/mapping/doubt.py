"""How much counts what does not agree with the rest [Agarwal et al. 2013]."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import rel_entr

from lidarcore.arrays import Array, Numbers
from lidarcore.compiled import inlined
from lidarcore.geometry import chi_square_gate

DOUBTFUL = chi_square_gate(0.99, 3)
"""Chi-square of a pose, three degrees of freedom, from which on it counts less."""

_CHANCE = 1 / 3  # share of a scan that fits at a place where it was not taken


def trust(chi2: Numbers, doubtful: float) -> Numbers:
    """Weights (...,) of what disagrees by chi2 (...,), 1 up to where it becomes doubtful [(15)]; kernels compile it."""
    return np.minimum(1.0, 2 / (1 + chi2 / doubtful)) ** 2


compiled_trust = inlined(trust)


def loss(chi2: ArrayLike, doubtful: ArrayLike) -> Array:
    """What disagreements by chi2 cost: the derivative is `trust`, so that none exceeds 3 times `doubtful`."""
    chi2, doubtful = np.asarray(chi2, np.float64), np.asarray(doubtful, np.float64)
    return np.where(chi2 < doubtful, chi2, doubtful * (3 - 4 / (1 + chi2 / doubtful)))


def evidence(fit: float, count: int) -> float:
    """Log-likelihood ratio of a place at which such a share of so many fits to one at which they fit by chance."""
    fit = max(fit, _CHANCE)
    return count * float(rel_entr(fit, _CHANCE) + rel_entr(1 - fit, 1 - _CHANCE))
