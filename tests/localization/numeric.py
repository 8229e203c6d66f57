"""Central differences: the independent truth for Jacobians."""

from collections.abc import Callable

import numpy as np

from lidarcore.scan import Array


def jacobian(function: Callable[[Array], Array], at: Array, step: float = 1e-5) -> Array:
    """Derivative of a function of (n,) to (m,): (m, n)."""
    columns = []
    for i in range(len(at)):
        offset = np.zeros(len(at))
        offset[i] = step
        columns.append((function(at + offset) - function(at - offset)) / (2 * step))
    return np.stack(columns, -1)
