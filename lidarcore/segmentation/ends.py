"""Where one wall ends and the next begins, decided by bearing.

Beams near a corner fit both walls. To give each to the wall that it happens to fit better is to choose by its noise,
and beams of the neighbour bend the line; the bearing at which the lines meet does not look at those beams' own noise.
"""

from lidarcore.arrays import Array
from lidarcore.compiled import inlined
from lidarcore.noise import NoiseModel
from lidarcore.segmentation.moments import line_of, moments_of
from lidarcore.segmentation.pieces import Pieces
from lidarcore.segmentation.split import variance

_PASSES = 2  # the lines follow their ends: the first pass takes out most of what is the neighbour's
_REACH, _REACH_ANGLE = 12, 0.08  # points, and rad, looked at on each side of a common end: whichever is more
# any other end is by chance so much likelier at less than 1 of 2981 corners: exp(-chi2 / 2)
_STEP_CHI2 = 16.0


@inlined
def place_ends(
    points: Array, pieces: Pieces, m: Array, count: int, increment: float, noise: NoiseModel
) -> None:
    """Move each common end of two neighbours in one run to where their lines meet, or to the likeliest step.

    The first `count` pieces are changed in place. The moments m (count, MOMENTS) are scratch, and afterwards not those
    of the pieces: the ends move once more after they were summed up.
    increment is the angle between beams, rad.
    """
    first, last, run = pieces.first, pieces.last, pieces.run
    reach = max(_REACH, int(_REACH_ANGLE / increment))
    for again in range(_PASSES):
        moments_of(points, first, last, m, count, trimmed=again == 0)
        for i in range(count - 1):
            if run[i] == run[i + 1]:
                last[i] = _common_end(points, first[i], last[i], last[i + 1], m[i], m[i + 1], reach, noise)
                first[i + 1] = last[i] + 1


@inlined
def _common_end(
    points: Array, first: int, end: int, last: int, a: Array, b: Array,
    reach: int, noise: NoiseModel,
) -> int:  # fmt: skip
    """The last point of the first of two pieces (first ... end, end + 1 ... last) with moments a and b.

    It is where the lines meet as seen from the sensor. If some other end near explains the points far better, the
    range steps from one wall to the other without their lines meeting: then it is that end.
    """
    rho, c, s = points[0], points[1], points[2]
    ax, ay, ar, _ = line_of(a)
    bx, by, br, _ = line_of(b)
    turn = ax * by - ay * bx
    x, y = (ar * by - br * ay) / turn, (br * ax - ar * bx) / turn
    # The noise is of the ranges: a wall seen at a grazing angle is near every point.
    w_a = _weight(rho[end], c[end], s[end], ax, ay, noise)
    w_b = _weight(rho[end], c[end], s[end], bx, by, noise)
    low, high = max(first + 1, end - reach), min(last - 1, end + reach)
    likeliest = meeting = low - 1
    cost = least = cost_meeting = 0.0
    for k in range(low, high):
        to_a, to_b = rho[k] * (ax * c[k] + ay * s[k]) - ar, rho[k] * (bx * c[k] + by * s[k]) - br
        cost += w_a * to_a * to_a - w_b * to_b * to_b
        if cost < least:
            likeliest, least = k, cost
        if c[k] * y - s[k] * x >= 0:
            meeting, cost_meeting = k, cost
    meet = low <= meeting < high - 1 and cost_meeting - least < _STEP_CHI2
    return meeting if meet else likeliest


@inlined
def _weight(rho: float, c: float, s: float, nx: float, ny: float, noise: NoiseModel) -> float:
    """Inverse variance of a point's distance from a line with this normal."""
    across, along = nx * c + ny * s, rho * (nx * s - ny * c)
    return 1 / variance(rho, across, along, noise)
