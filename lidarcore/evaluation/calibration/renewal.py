"""What of a wall's unevenness the next scan from the same place does not repeat."""

import numpy as np

from lidarcore.evaluation.repeatability.wall_tracker import WallTracker, told_near
from lidarcore.extraction import extract
from lidarcore.features import Features
from lidarcore.geometry import contains
from lidarcore.noise import SensorNoise
from lidarcore.scan import Array, Scan
from lidarcore.settings import ExtractionSettings

_LEAST = 10  # observations of a wall
_HELD = 0.95  # of the scatter of walls, by ellipses of 95 %
_WINDOW = 100  # scans: what drifts for longer is not noise
# scans after a start, of real sensors: walls lie four times as far off as later, and then no more
_SETTLING = 10
_LAGS = 8  # scans apart, at which bearings are compared

_STEPS = np.linspace(0.0, 1.0, 21)


def renewal(scans: list[Scan], noise: SensorNoise) -> float:
    """The share (0 to 1) that the median wall needs for its 95 % ellipses to hold as much of how it scatters.

    What beams between others find of the same wall is known (`resampling`). But where walls begin and end changes, and
    what little moves: that shows in how the lines of walls scatter, and nowhere else. Walls that fall apart in every
    other scan need far more than the rest; they do not make the ellipses of all others larger.
    """
    if noise.unevenness == 0:
        return 1.0
    needed, observations = [], []
    for begin in range(_SETTLING if len(scans) > 4 * _SETTLING else 0, len(scans), _WINDOW):
        window = scans[begin : begin + _WINDOW]
        least, most = (_observations(window, noise, share) for share in (0.0, 1.0))
        for wall, first in least.items():
            if len(first) >= _LEAST and len(most[wall]) == len(first):
                needed.append(_needed(first, most[wall]))
                observations.append(len(first))
    return _weighted_median(np.array(needed), np.array(observations)) if needed else 1.0


def _needed(repeated: Array, anew: Array) -> float:
    """The least share at which the ellipses of one wall (N, 6) hold 95 % of its scatter."""
    errors = (repeated[:, :2] - repeated[:, :2].mean(0)) / np.sqrt(1 - 1 / len(repeated))
    c0, c1 = (rows[:, 2:].reshape(-1, 2, 2) for rows in (repeated, anew))
    for share in _STEPS.tolist():
        if contains(errors, c0 + share * (c1 - c0), _HELD).mean() >= _HELD:
            return float(share)
    return 1.0


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(below, below[-1] / 2)])


def resampling(scans: list[Scan]) -> float:
    """How far beams fall elsewhere from scan to scan: 0 on the same bearings, 1 anywhere between their neighbours.

    Twelve times the mean square of the shift over the spacing, which is 1 for a shift that is anywhere. Scans close to
    each other and far apart are compared: where bearings creep, the next scan repeats nearly all of them, a later one
    none.
    """
    apart = np.unique(np.linspace(1, min(len(scans), _WINDOW) - 1, _LAGS).astype(int)).tolist()
    squares = [
        _shifts(before.bearings, after.bearings) ** 2
        for lag in apart
        for before, after in zip(scans, scans[lag:], strict=False)
    ]
    return min(float(12 * np.mean(np.concatenate(squares))), 1.0)


def _shifts(before: Array, after: Array) -> Array:
    """(N,) from each bearing to the nearest one of another scan, over the spacing there; at most a half."""
    there = np.sort(before % (2 * np.pi))
    there = np.concatenate([there[-1:] - 2 * np.pi, there, there[:1] + 2 * np.pi])
    here = after % (2 * np.pi)
    next_ = np.searchsorted(there, here).clip(1, len(there) - 1)
    low, high = there[next_ - 1], there[next_]
    shifts: Array = np.minimum(here - low, high - here) / np.maximum(high - low, 1e-9)
    return shifts


def _observations(scans: list[Scan], noise: SensorNoise, share: float) -> dict[int, Array]:
    """Each wall's observations (N, 6): alpha rad, r m, their covariance if that share is sampled again in each scan."""
    told = {name: getattr(noise, name) for name in noise.__dataclass_fields__} | {"renewal": share}
    settings = ExtractionSettings(noise=SensorNoise(**told))
    tracker, seen = WallTracker(memory=len(scans), follow=0.1), dict[int, list[Array]]()
    for scan in scans:
        found: Features = extract(scan, settings)
        rows, lines = tracker.rows({found.fitter: found}), found.lines
        walls = [row.index[found.fitter] for row in rows]
        table = np.column_stack([lines.alpha, lines.r, lines.covariance_consistent.reshape(-1, 4)])[walls]
        told_rows = told_near(table, np.array([row.near for row in rows]))
        for row, one in zip(rows, told_rows, strict=True):
            seen.setdefault(row.id, []).append(one)
    return {wall: np.array(rows) for wall, rows in seen.items()}
