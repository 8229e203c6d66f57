"""Where nodes were looked for already: what was found where the graph expected them is looked up, not sought again."""

import numpy as np

from lidarcore.geometry import UncertainPose, pose_difference
from lidarcore.mapping.loops.consistency import Loop

# Standard deviations by which a pose, and share by which its covariance, may differ from what was expected before:
# a search goes three standard deviations far, and ends at the same surfaces.
_MOVED, _GROWN = 0.1, 0.1


class Tried:
    """Loops of nodes at earlier ones, as long as the graph expects the same of both."""

    def __init__(self) -> None:
        self._found: dict[tuple[int, int], tuple[UncertainPose, list[Loop]]] = {}

    def get(self, i: int, k: int, expected: UncertainPose) -> list[Loop] | None:
        """What was found of node k at node i when T_i_k was expected so; None if that has not been tried."""
        before, loops = self._found.get((i, k), (None, None))
        return loops if before is not None and _is_alike(before, expected) else None

    def put(self, i: int, k: int, expected: UncertainPose, loops: list[Loop]) -> None:
        """That was found where T_i_k was expected so."""
        self._found[i, k] = expected, loops


def _is_alike(a: UncertainPose, b: UncertainPose) -> bool:
    sigma = np.sqrt(np.diagonal(a.covariance))
    moved = np.abs(pose_difference(b.pose, a.pose)) / sigma
    grown = np.abs(b.covariance - a.covariance) / np.outer(sigma, sigma)
    return bool(moved.max() < _MOVED and grown.max() < _GROWN)
