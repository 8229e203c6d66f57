"""Ellipses after calibration: each station's first half tells the noise, its second half judges what it leads to."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from lidarcore.arrays import Array, Columns, Ints
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.calibration.calibrate import calibrate
from lidarcore.evaluation.consistency.design import KINDS
from lidarcore.evaluation.consistency.figures import LEVELS
from lidarcore.evaluation.intervals import LEVEL, UNKNOWN, Interval, share
from lidarcore.evaluation.repeatability.scatter import LEAST, Scatter
from lidarcore.evaluation.repeatability.statistics import WINDOW, Repeatability
from lidarcore.extraction import compare
from lidarcore.noise import SensorNoise
from lidarcore.scan import Scan
from lidarcore.settings import Covariance, ExtractionSettings

ENOUGH = 200
"""Observations at one station from which on its coverage stands for itself;"""
WINDOWS = 5
"""or windows."""
SHORTEST = 40  # scans of a station that is judged at all


@dataclass(frozen=True, slots=True, eq=False)
class Figures(Columns):
    """F features, each judged in one window, by M methods: corners in m², walls in rad m.

    counts (F, M) of sightings; hits (F, M) of them in the 95 % ellipse; claimed and actual (F, M), root(det) of the
    mean claimed covariance and of the scatter, NaN where a method saw it too rarely; window and station (F,).
    """

    counts: Array
    hits: Array
    claimed: Array
    actual: Array
    window: Ints
    station: Ints

    @classmethod
    def of(cls, found: Scatter, kind: int, window: int, station: int) -> "Figures":
        """Figures of one window."""
        good = found.counts >= LEAST
        some = good.any(1)
        numbers = np.ones(int(some.sum()), np.int64)
        scatters = good & (found.actual > 0)
        return cls(
            np.where(good, found.counts, 0.0)[some],
            np.where(good, found.hits[:, :, kind, LEVELS.index(0.95)], 0.0)[some],
            np.where(scatters, found.claimed[..., kind], np.nan)[some],
            np.where(scatters, found.actual, np.nan)[some],
            window * numbers,
            station * numbers,
        )

    def stands(self, method: int) -> bool:
        """Whether coverage stands for itself, if these are of one station."""
        windows = len(np.unique(self.window[self.counts[:, method] > 0]))
        return self.sightings(method) >= ENOUGH or windows >= WINDOWS

    def sightings(self, method: int) -> int:
        """Number of them."""
        return int(self.counts[:, method].sum())

    def coverage(self, method: int) -> Interval:
        """Share of the scatter in the 95 % ellipses; windows are what errors are independent between."""
        return share(*self._by(self.window, method).T)

    def stations(self) -> dict[int, "Figures"]:
        """Figures of each station by its number."""
        return {number: self[self.station == number] for number in np.unique(self.station).tolist()}

    def by_station(self, method: int) -> dict[int, tuple[float, int]]:
        """Coverage and number of sightings of each station that saw a feature."""
        sums = zip(self.stations(), self._by(self.station, method).tolist(), strict=True)
        return {number: (hits / n, int(n)) for number, (hits, n) in sums if n}

    def extremes(self, method: int) -> tuple[float, float] | None:
        """Coverage of the lowest and the highest station of those that stand for themselves; None if there are none."""
        held, stations = self.by_station(method), self.stations()
        shares = [share for number, (share, _) in held.items() if stations[number].stands(method)]
        return (min(shares), max(shares)) if shares else None

    def area_ratio(self, method: int) -> Interval:
        """Claimed over actual area: geometric mean over features, each weighted by its sightings."""
        with np.errstate(divide="ignore"):
            return self._geometric(np.log(self.claimed[:, method] / self.actual[:, method]), method)

    def scatter_against(self, method: int, other: int) -> Interval:
        """The area of the scatter over that of another method: the same mean, over features that both saw."""
        return self._geometric(np.log(self.actual[:, method] / self.actual[:, other]), method)

    def _by(self, groups: Ints, method: int) -> Array:
        """(G, 2) hits and sightings."""
        group = np.unique(groups, return_inverse=True)[1]
        columns = (self.hits[:, method], self.counts[:, method])
        return np.column_stack([np.bincount(group, column) for column in columns])

    def _geometric(self, logs: Array, method: int) -> Interval:
        """Windows are what errors are independent between, and Student's t knows how few they are."""
        seen = np.isfinite(logs)
        if not seen.any():
            return UNKNOWN
        weights = self.counts[seen, method]
        mean = float(np.average(logs[seen], weights=weights))
        window = np.unique(self.window[seen], return_inverse=True)[1]
        blocks = np.bincount(window, weights * (logs[seen] - mean))
        n = len(blocks)
        if n < 2:
            return Interval(float(np.exp(mean)), 0.0, np.inf)
        error = float(np.sqrt((blocks**2).sum() * n / (n - 1)) / weights.sum())
        half = float(stdtrit(n - 1, (1 + LEVEL) / 2)) * error
        return Interval(*np.exp([mean, mean - half, mean + half]).tolist())


@dataclass(frozen=True, slots=True)
class Station:
    """One station: its name, scans, the noise it was judged with, and what was not calibrated and why."""

    name: str
    scans: int
    noise: SensorNoise
    remark: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class StationStudy:
    """All stations together, by several methods."""

    methods: tuple[str, ...]
    stations: tuple[Station, ...]
    walls: Figures
    corners: Figures


def study(
    stations: Iterable[tuple[str, Sequence[Scan]]],
    methods: Sequence[str],
    settings: ExtractionSettings | None = None,
    *,
    window: int = WINDOW,
    calibrated: bool = True,
    covariance: Covariance = "consistent",
    tell: Callable[[int], None] = lambda judged: None,
) -> StationStudy:
    """Judge every station (name, scans) in windows of its second half, with the noise that its first half tells.

    Not calibrated, or where the first half tells nothing, the noise is that of the settings. Stations of fewer than
    SHORTEST scans are left out; `tell` is called with the number of those judged so far.
    Raises EvaluationError if none is left.
    """
    settings, kind = settings or ExtractionSettings(), KINDS.index(covariance)
    judged: list[Station] = []
    walls: list[Figures] = []
    corners: list[Figures] = []
    for name, scans in stations:
        if len(scans) < SHORTEST:
            continue
        half = len(scans) // 2
        station = Station(name, len(scans), settings.noise)
        if calibrated:
            station = _calibrated(station, scans[:half])
        chosen = replace(settings, noise=station.noise)
        for part in _windows(scans[half:], window):
            found = seen(part, chosen, methods)
            walls.append(Figures.of(found.walls.scatter(), kind, len(walls), len(judged)))
            corners.append(Figures.of(found.corners.scatter(), kind, len(corners), len(judged)))
        judged.append(station)
        tell(len(judged))
    if not judged:
        raise EvaluationError(
            f"There is no station to judge: the sensor should stand still for {SHORTEST} scans at least."
        )
    return StationStudy(tuple(methods), tuple(judged), Figures.joined(walls), Figures.joined(corners))


def _calibrated(station: Station, scans: Sequence[Scan]) -> Station:
    try:
        return replace(station, noise=calibrate(scans).noise_or(station.noise))
    except EvaluationError as error:
        return replace(station, remark=f"not calibrated: {error}")


def _windows(scans: Sequence[Scan], window: int) -> list[Sequence[Scan]]:
    """Whole windows one after another, or all scans if they do not fill one."""
    return [scans[i * window : (i + 1) * window] for i in range(len(scans) // window)] or [scans]


def seen(scans: Sequence[Scan], settings: ExtractionSettings, methods: Sequence[str]) -> Repeatability:
    """Walls and corners of scans from one place, by several methods."""
    found = Repeatability(max(len(scans), LEAST), methods, standing=True)
    for scan in scans:
        found.add(compare(scan, settings, methods))
    return found
