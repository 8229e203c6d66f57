"""What is asked of ellipses at real stations, and whether it is met."""

from collections.abc import Iterator
from dataclasses import dataclass

from lidarcore.evaluation.stations.study import StationStudy

COVERAGE = (0.93, 0.98)  # of 95 % ellipses, all stations together
LOWEST_STATION = 0.88  # of those with sightings or windows enough to stand for themselves
AREA_RATIO = 3.0  # claimed over actual area, at most
SCATTER = 0.9  # area of the scatter of walls over that of the reference, at most
REFERENCE = "utls"
"""The method whose scatter the others' is compared with."""


@dataclass(frozen=True, slots=True)
class Limit:
    """A figure of one method beside what is asked of it; low or high is None where nothing is asked."""

    of: str
    method: str
    figure: str
    value: float
    low: float | None
    high: float | None

    @property
    def held(self) -> bool:
        """A figure that is not known holds nothing."""
        return (self.low is None or self.value >= self.low) and (self.high is None or self.value <= self.high)


def limits(study: StationStudy, method: str) -> Iterator[Limit]:
    """All that is asked of one method; what no feature tells is left out."""
    m = study.methods.index(method)
    for of, figures in (("walls", study.walls), ("corners", study.corners)):
        if figures.sightings(m):
            yield Limit(of, method, "in 95 % ellipses", figures.coverage(m).value, *COVERAGE)
            if (extremes := figures.extremes(m)) is not None:
                yield Limit(of, method, "lowest station", extremes[0], LOWEST_STATION, None)
            yield Limit(of, method, "claimed / scatter", figures.area_ratio(m).value, None, AREA_RATIO)
    yield from _scatter(study, m)


def _scatter(study: StationStudy, m: int) -> Iterator[Limit]:
    """Less of walls; of corners, and at any one station, only not more than chance explains."""
    if REFERENCE not in study.methods or study.methods[m] == REFERENCE:
        return
    method, other, heading = study.methods[m], study.methods.index(REFERENCE), f"scatter / {REFERENCE}"
    if study.walls.sightings(m):
        yield Limit("walls", method, heading, study.walls.scatter_against(m, other).value, None, SCATTER)
    for of, figures in (("walls", study.walls), ("corners", study.corners)):
        lows = [one.scatter_against(m, other).low for one in figures.stations().values() if one.stands(m)]
        known = [low for low in lows if low == low]
        if known:
            yield Limit(of, method, f"{heading}, surely, worst station", max(known), None, 1.0)
