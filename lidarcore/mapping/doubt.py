"""How much counts what does not agree with the rest [Agarwal et al. 2013]."""

import numpy as np
from scipy.special import rel_entr

from lidarcore.arrays import Numbers
from lidarcore.compiled import inlined
from lidarcore.geometry import chi_square_gate

DOUBTFUL = chi_square_gate(0.99, 3)
"""Chi-square of a pose, three degrees of freedom, from which on it counts less."""

_CHANCE = 1 / 3  # share of a scan that fits at a place where it was not taken


def trust(chi2: Numbers, doubtful: float) -> Numbers:
    """Weights (...,) of what disagrees by chi2 (...,), 1 up to where it becomes doubtful [(15)]; kernels compile it."""
    return np.minimum(1.0, 2 / (1 + chi2 / doubtful)) ** 2


compiled_trust = inlined(trust)


def loss(chi2: float, doubtful: float) -> float:
    """What a disagreement by chi2 costs: its derivative is `trust`, so that it never exceeds 3 times `doubtful`."""
    return chi2 if chi2 < doubtful else doubtful * (3 - 4 / (1 + chi2 / doubtful))


def evidence(fit: float, count: int) -> float:
    """Log-likelihood ratio of a place at which such a share of so many fits to one at which they fit by chance."""
    fit = max(fit, _CHANCE)
    return count * float(rel_entr(fit, _CHANCE) + rel_entr(1 - fit, 1 - _CHANCE))
