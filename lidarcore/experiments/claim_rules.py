"""When a claim of a paper agrees with what was measured: one rule for each kind of claim."""

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtri

from lidarcore.arrays import Array
from lidarcore.evaluation.intervals import LEVEL, Interval
from lidarcore.reporting import NOT_COMPARABLE, Agreement

Claim = tuple[str, str, Agreement]
"""What the paper says, what was measured, and whether that agrees; None where what was measured leaves it open."""

TOLERANCE = 0.25  # of a ratio the paper gives
POINTS = 10  # percentage points, of a percentage the paper gives
FEW = 0.05  # "a few per cent"
RULES = (
    "The verdicts follow fixed rules. Where the paper gives a ratio, it agrees if all of the measured interval is "
    f"within {100 * TOLERANCE:.0f} % of it; where it gives a range of factors, eight of ten corners must be within it, "
    f"with that tolerance; a percentage must be within {POINTS} percentage points, and “a few per cent” is "
    f"{100 * FEW:.0f} % for nine of ten. Where it gives only an order (smaller, faster, better), the order must hold "
    "over all of the interval, with one exception where the paper allows one. Of two ellipses that is the better whose "
    "share of the corners is nearer to 95 %; places are equivalent if they are nearer to each other than to the truth. "
    "An interval that includes the limit leaves the claim open. Figures in mm, mm² and µs are not comparable: they "
    "belong to the paper's rooms, sensor and computer."
)
NO_ROOM = "Not comparable: the rooms and scans of the paper are not public, and these are others."
_Z = float(ndtri((1 + LEVEL) / 2))  # two-sided

NOISE_ASSUMED = "Open: the noise of this sensor is assumed, and with another noise all shares are others."


def below(measured: Interval, limit: float) -> bool | None:
    """Whether an order holds: a figure that must be below a limit."""
    return None if measured.low < limit <= measured.high else measured.high < limit


def within(measured: Interval, least: float, most: float) -> bool | None:
    """Whether all of the interval is in a range; False if none of it is."""
    if least <= measured.low and measured.high <= most:
        return True
    return None if measured.low <= most and measured.high >= least else False


def as_large(measured: Interval, paper: float) -> bool | None:
    """Whether a ratio is that of the paper."""
    return within(measured, (1 - TOLERANCE) * paper, (1 + TOLERANCE) * paper)


def in_range(measured: Interval, least: float, most: float) -> bool:
    """Whether the ratios of many corners, most of them from low to high, are the range that the paper gives."""
    return within(measured, (1 - TOLERANCE) * least, (1 + TOLERANCE) * most) is True


def percentages(measured: Sequence[float], paper: float) -> bool:
    """Whether all of some percentages are that of the paper."""
    return all(abs(value - paper) <= POINTS for value in measured)


def nearer(one: Interval, other: Interval, target: float) -> bool | None:
    """Whether one figure is nearer to a target than the other."""
    (near, far), (other_near, other_far) = _distances(one, target), _distances(other, target)
    if far < other_near:
        return True
    return False if near > other_far else None


def _distances(figure: Interval, target: float) -> tuple[float, float]:
    ends = abs(figure.low - target), abs(figure.high - target)
    return (0.0 if figure.contains(target) else min(ends)), max(ends)


def every(verdicts: Sequence[bool | None]) -> bool | None:
    """Verdict on a claim of several figures: it differs if one of them does."""
    return False if False in verdicts else None if None in verdicts else True


def judged(claim: str, measured: str, verdict: Agreement, why: str = "") -> Claim:
    """A claim with its verdict, and with the reason where they differ."""
    return claim, f"{measured} {why}" if why and verdict is False else measured, verdict


def on_coverage(claim: str, measured: str, known: bool, one: Interval, other: Interval, why: str) -> Claim:
    """A claim that one share of corners within 95 % ellipses is better than another; open if no noise is known."""
    if not known:
        return claim, f"{measured} {NOISE_ASSUMED}", None
    return judged(claim, measured, nearer(one, other, 0.95), why)


def not_comparable(claim: str, measured: str, why: str = NO_ROOM) -> Claim:
    """A figure of the paper that belongs to its rooms, sensor or computer."""
    return claim, f"{measured} {why}", NOT_COMPARABLE


def median_ratio(numerators: Array, denominators: Array) -> Interval:
    """Median over median, with an interval from the order statistics of both: a little too long, never too short."""
    (a, a_low, a_high), (b, b_low, b_high) = (_median(values) for values in (numerators, denominators))
    return Interval(a / b, a_low / b_high, a_high / b_low)


def _median(values: Array) -> tuple[float, float, float]:
    n = len(values)
    reach = _Z * n**0.5 / 2
    low, high = max(int(np.floor(n / 2 - reach)) - 1, 0), min(int(np.ceil(n / 2 + reach)), n - 1)
    ordered = np.sort(values)
    return float(np.median(values)), float(ordered[low]), float(ordered[high])


def in_words(figure: Interval, factor: float = 1.0) -> str:
    """A figure with its confidence interval."""
    digits = 1 if factor == 100 else 3 if figure.value < 2 else 2
    return figure.span(digits, factor, " to ")
