"""Walls of a real room, seen twice by sensors at rest: what scatters, and what each method claims."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from lidarcore.extraction import extract
from lidarcore.lines import FITTERS, Line
from lidarcore.recordings import open_recording
from lidarcore.scan import Array, Scan
from lidarcore.sensors import SENSORS
from lidarcore.settings import Covariance, ExtractionSettings

_FOLDER = Path(__file__).parents[2] / "tests/data/tau_rplidar_c1_rooms"
_RECORDINGS = ("lab446__scans.json", "lab446__scans.old.json")
_SENSORS = [f"dev{n}" for n in range(1, 6)]
_BEAMS, _LENGTH, _DISTANCE = 40, 0.7, 0.5  # of a wall that is taken, at least; m
_TRIM = 0.1  # of its beams, left out at each end, where the wall may end
STRETCHES = 8  # of a wall, left out in turn
NOISE = SENSORS["rplidar_c1"].noise
STRAIGHT = replace(NOISE, unevenness=0.0)


@dataclass(frozen=True, eq=False)
class WallScan:
    """Beams of one scan on one wall: ranges (N,) m and bearings (N,) rad, in the order of the wall."""

    ranges: Array
    bearings: Array

    def fit(self, fitter: str = "ml", straight: bool = False) -> Line:
        """The wall's line; straight: as if walls were."""
        return FITTERS[fitter].fit(self.ranges, self.bearings, STRAIGHT if straight else NOISE)

    def profile(self) -> Array:
        """(2, N) m: along the wall, and off its line."""
        line = self.fit()
        incidence = self.bearings - line.alpha
        profile: Array = self.ranges * np.array([np.sin(incidence), np.cos(incidence)]) - [[0.0], [line.r]]
        return profile

    def neighbours(self) -> float:
        """Correlation of what neighbouring beams are off the line."""
        off = self.profile()[1]
        return float(off[1:] @ off[:-1] / (off @ off))

    def scatter(self, groups: int) -> Array:
        """(2,) standard deviations of angle (rad) and distance (m), from fits without one group of neighbours each.

        The jackknife: it takes groups for independent, but not the beams in them.
        """
        lines = [
            WallScan(np.delete(self.ranges, out), np.delete(self.bearings, out)).fit()
            for out in np.array_split(np.arange(len(self.ranges)), groups)
        ]
        of = np.array([[line.alpha, line.r] for line in lines])
        deviations: Array = np.sqrt((groups - 1) * np.unwrap(of, axis=0).var(0))
        return deviations


@dataclass(frozen=True, eq=False)
class RealWall:
    """One wall in both recordings."""

    scans: tuple[WallScan, WallScan]

    @property
    def distance(self) -> float:
        """m, from the sensor."""
        return self.scans[0].fit().r

    @property
    def length(self) -> float:
        """m"""
        return float(np.ptp(self.scans[0].profile()[0]))

    def claim(self, fitter: str, kind: Covariance, straight: bool) -> Array:
        """(2,) standard deviations of angle (rad) and distance (m), root mean squares of both scans."""
        lines = [scan.fit(fitter, straight) for scan in self.scans]
        return _rms([np.sqrt(np.diag(getattr(line, f"covariance_{kind}"))) for line in lines])

    def scatter(self, by_beams: bool = False) -> Array:
        """(2,) the same as it is, without single beams or without stretches of the wall."""
        return _rms([scan.scatter(len(scan.ranges) if by_beams else STRETCHES) for scan in self.scans])

    def repeats(self) -> float:
        """Correlation of what both scans are off the line, at the places of the first."""
        (t, off), other = (scan.profile() for scan in self.scans)
        forward = np.argsort(other[0])
        return float(np.corrcoef(off, np.interp(t, *other[:, forward]))[0, 1])


@cache
def walls() -> list[RealWall]:
    """All walls with enough beams that both recordings have; first the one on which bearings matter least."""
    found = []
    for sensor in _SENSORS:
        one, other = (_long_walls(once(_scan(name, sensor))) for name in _RECORDINGS)
        found += [RealWall((a, b)) for a in one for b in other if _same(a.fit(), b.fit())]
    return sorted(found, key=lambda wall: float(np.abs(wall.scans[0].profile()[0]).max()))


def once(scan: Scan) -> Scan:
    """The scan with ranges that the recorder wrote into neighbouring bins of bearing taken once, between them."""
    group = np.cumsum(np.diff(scan.ranges, prepend=scan.ranges[0]) != 0)
    n = np.bincount(group)
    return Scan(np.bincount(group, scan.ranges) / n, np.bincount(group, scan.bearings) / n)


def values() -> Mapping[str, float]:
    """What the words say of them; ratios are of the scatter over what `ml` claims."""
    first = walls()[0]

    def ratio(straight: bool) -> float:
        over = [wall.scatter() / wall.claim("ml", "consistent", straight) for wall in walls()]
        return float(_rms(_rms(over)))

    return {
        "walls": float(len(walls())),
        "stretches": float(STRETCHES),
        "known_to": float(1 / np.sqrt(2 * (STRETCHES - 2))),  # chi-square, a line takes two
        "least_length": _LENGTH,
        "least_distance": _DISTANCE,
        "least_beams": float(_BEAMS),
        "neighbours": float(np.mean([scan.neighbours() for scan in first.scans])),
        "repeats": first.repeats(),
        "straight": ratio(True),
        "uneven": ratio(False),
    }


def _scan(name: str, sensor: str) -> Scan:
    return next(iter(open_recording(_FOLDER / name, sensor)))


def _long_walls(scan: Scan) -> list[WallScan]:
    found = []
    segments = extract(scan, ExtractionSettings(noise=NOISE)).segments
    enough = (segments.n_points >= _BEAMS) & (segments.length >= _LENGTH) & (segments.lines.r >= _DISTANCE)
    for first, last in zip(segments.first_beam[enough], segments.last_beam[enough], strict=True):
        beams = np.arange(first, last + 1 + len(scan) * (last < first)) % len(scan)
        cut = round(_TRIM * len(beams))
        found.append(WallScan(scan.ranges[beams[cut:-cut]], scan.bearings[beams[cut:-cut]]))
    return found


def _same(a: Line, b: Line) -> bool:
    return bool(np.linalg.norm(a.r * a.normal - b.r * b.normal) < 0.05)


def _rms(values: Array | list[Array]) -> Array:
    of: Array = np.sqrt(np.mean(np.square(values), axis=0))
    return of
