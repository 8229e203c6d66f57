"""What the even spacing of nodes tells where no checksum does: angles that are wrong, and nodes that never came.

The angles of an S1 are even. Those of an A1 jitter by degrees, but a step that is too long is made up for by others, so
that the number of nodes in a turn is right all the same.
"""

import numpy as np

from lidarcore.arrays import Bools, Ints
from lidarcore.rplidar.decoding.revolution import TURN

LEAST_NODES = 32  # in a turn, of which a usual step can be told
ORDINARY = 0.8  # so many of the nodes are ordinary
EVEN = 1 << 11  # 1/65536 degree: ordinary angles are off by rounding alone, or none is judged
LEAST_MISFIT = 1 << 16  # 1/65536 degree: an angle off by less is left alone
NEAR = 0.2  # of the usual step: neither jitter nor a loss
LONG = 1.6  # of the usual step: a node is missing


def misfits(turned: Ints) -> Bools:
    """(N,) true for nodes far from the middle of neighbours two steps apart, turned (N,) 1/65536 degree.

    Only where the others are even: sound angles of an A1 now and then go back by degrees.
    """
    wrong = np.zeros(len(turned), bool)
    if len(turned) < LEAST_NODES:
        return wrong
    before, here, after = turned[:-2], turned[1:-1], turned[2:]
    off, usual = np.abs(here - (before + after) / 2), _usual(np.diff(turned))
    is_known = np.abs(after - before - 2 * usual) <= NEAR * usual
    if np.quantile(off, ORDINARY) <= EVEN:
        wrong[1:-1] = is_known & (off > LEAST_MISFIT)
    return wrong


def missing(turned: Ints) -> Ints:
    """(G, 2) 1/65536 degree: where nodes are missing between two others, as wide as their share of the turn.

    So many as the turn lacks, where the steps are longest.
    """
    if len(turned) < LEAST_NODES:
        return np.empty((0, 2), np.int64)
    steps = np.diff(turned)
    if np.median(steps) < 1:  # it stands, or turns backward
        return np.empty((0, 2), np.int64)
    usual = _usual(steps)
    long = np.argsort(-steps, kind="stable")[: np.sum(steps > LONG * usual)]
    lacking = np.cumsum(np.rint(steps[long] / usual) - 1)
    expected = int(TURN / usual - 0.5)  # a turn may have one node more or less than another
    found = np.sort(long[lacking <= expected - len(turned)])
    half = int(usual / 2)
    return np.stack([turned[found] + half, turned[found + 1] - half], -1)


def _usual(steps: Ints) -> float:
    """The step between two nodes: the mean of those near the median, which is rounded as the angles are."""
    median = float(np.median(steps))
    near = steps[np.abs(steps - median) <= NEAR * median]
    return float(near.mean()) if len(near) else median
