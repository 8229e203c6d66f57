"""Which keyframes a map can do without: where a sensor was often, the first and the last few of each view say enough.

The first ones tie every later pass to the same nodes, so that the graph stays sparse; the last ones know what changed.
"""

import numpy as np

from lidarcore.arrays import Array, Ints

_PLACE, _SECTORS = 0.5, 8  # m and number of headings within which views are alike
_FIRST, _LAST = 3, 3  # views of a place that stay
_RECENT = 50  # last keyframes, all of which stay


def spare(nodes: Ints, poses: Array) -> Ints:
    """Those of the nodes (N,), in the order of their time, at poses (N, 3), whose scans the map can do without."""
    sector = np.floor(poses[:, 2] * _SECTORS / (2 * np.pi)) % _SECTORS
    views = np.column_stack([np.floor(poses[:, :2] / _PLACE), sector])
    _, view, count = np.unique(views, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(view, kind="stable")
    rank = np.empty(len(nodes), np.int64)  # among those of the same view, by time
    rank[order] = np.arange(len(nodes)) - np.repeat(np.cumsum(count) - count, count)
    between = (rank >= _FIRST) & (rank < count[view] - _LAST)
    between[-_RECENT:] = False
    found: Ints = nodes[between]
    return found
