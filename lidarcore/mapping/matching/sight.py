"""What a scan saw, and what it looked through: where another scan should agree with it, and where it cannot."""

from typing import NamedTuple

import numpy as np

from lidarcore.arrays import Array
from lidarcore.compiled import kernel
from lidarcore.geometry import relative
from lidarcore.geometry.kernels import rotate, wrap
from lidarcore.scan import Scan

# Between returns farther apart than both nothing was seen.
_APART = 0.1  # rad
_BEAMS = 2.0  # times the spacing of beams
_MANY = 2 + 4 * np.pi * _BEAMS / _APART  # beams: no half of their spacings can be so wide that it matters
_CONFLICT = 0.2  # m by which a point must lie before a surface to contradict it


class Sight(NamedTuple):
    """The returns of a scan in the order of their bearings.

    bearings  (N,) rad in (-pi, pi]
    ranges    (N,) m
    apart     rad between two of them from which on nothing is known of what lies between
    """

    bearings: Array
    ranges: Array
    apart: float


def sight(scan: Scan) -> Sight:
    """The returns of a scan."""
    return Sight(*_sorted(scan.bearings, scan.ranges), _apart(scan.bearings))


@kernel
def _sorted(bearings: Array, ranges: Array) -> tuple[Array, Array]:
    """Bearings (K,) in (-pi, pi] and ranges of the returns, of beams (N,) in the order of the ring."""
    seen_at, seen, n, first = np.empty_like(bearings), np.empty_like(ranges), 0, 0
    for k in range(len(ranges)):
        if not np.isnan(ranges[k]):
            seen_at[n], seen[n] = wrap(bearings[k]), ranges[k]
            if seen_at[n] < seen_at[first]:
                first = n
            n += 1
    seen_at = np.concatenate((seen_at[first:n], seen_at[:first]))
    seen = np.concatenate((seen[first:n], seen[:first]))
    if (seen_at[1:] < seen_at[:-1]).any():  # a full turn and a little more
        order = np.argsort(seen_at, kind="mergesort")
        return seen_at[order], seen[order]
    return seen_at, seen


@kernel
def _apart(bearings: Array) -> float:
    """Rad between two returns of beams at bearings (N,) from which on nothing is known of what lies between."""
    if not 1 < len(bearings) < _MANY:
        return _APART
    turned = np.empty_like(bearings)
    for k in range(len(bearings)):
        turned[k] = wrap(bearings[k])
    return float(max(_APART, _BEAMS * np.median(np.diff(np.sort(turned)))))


@kernel
def agreement(reference: Sight, scan: Sight, pose: Array, margin: float) -> tuple[float, float]:
    """Shares of the scan's points that lie about where the reference saw something, and nearer than that.

    pose (3,) is T_reference_scan, margin in m, and a tenth of the range; points where the reference saw nothing count
    as neither.
    """
    c, s = np.cos(pose[2]), np.sin(pose[2])
    N, last, seen, nearer = len(scan.bearings), len(reference.bearings) - 1, 0, 0
    for i in range(N):
        x, y = scan.ranges[i] * np.cos(scan.bearings[i]), scan.ranges[i] * np.sin(scan.bearings[i])
        u, v = rotate(c, s, x, y)
        u, v = pose[0] + u, pose[1] + v
        k = np.searchsorted(reference.bearings, np.arctan2(v, u))
        if k == 0 or k > last or reference.bearings[k] - reference.bearings[k - 1] > reference.apart:
            continue
        near, far = reference.ranges[k - 1], reference.ranges[k]
        if near > far:
            near, far = far, near
        rho = np.hypot(u, v)
        slack = margin + 0.1 * rho
        if rho < near - slack:
            nearer += 1
        elif rho < far + slack:
            seen += 1
    return seen / max(N, 1), nearer / max(N, 1)


def conflicts(a: Sight, b: Sight, pose: Array) -> float:
    """Largest share of either scan that lies where the other one looked through, at T_a_b (3,)."""
    there, back = agreement(a, b, pose, _CONFLICT), agreement(b, a, relative(pose, np.zeros(3)), _CONFLICT)
    return max(there[1], back[1])
