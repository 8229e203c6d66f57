"""Agreement between the stations of recordings: what neighbours say of the same walls, against what is claimed."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from lidarcore.errors import EvaluationError
from lidarcore.evaluation.calibration.calibrate import calibrate
from lidarcore.evaluation.intervals import Interval, share
from lidarcore.evaluation.stations.agreement import GATE, Differences, Pair, differences, systematic_part
from lidarcore.evaluation.stations.feature_set import FeatureSet
from lidarcore.extraction import extract
from lidarcore.mapping import MatchSettings
from lidarcore.mapping.matching.correlative import search
from lidarcore.mapping.matching.patches import patches
from lidarcore.mapping.matching.registration import Registration, information_of, register
from lidarcore.mapping.matching.surfels import surfels
from lidarcore.noise import SensorNoise
from lidarcore.scan import Scan
from lidarcore.settings import Covariance, ExtractionSettings

SCANS = 20  # scans from each station, each paired with one from the next
_APART = np.array([0.3, 0.3, 0.2])  # m, rad: standard deviation of neighbouring stations
_INLIERS = 0.5  # share of a scan that must lie on the other, for the stations to be neighbours
_LEAST_PAIRS = 2


@dataclass(frozen=True, slots=True)
class Agreement:
    """How much of the differences 95 % ellipses hold, and the systematic part (m) they were given.

    walls, corners    shares with intervals of 95 % confidence: errors are independent between pairs of stations
    pairs             of walls, the share of each pair of stations by its name
    """

    systematic: tuple[float, ...]
    walls: Interval
    corners: Interval
    differences: int
    pairs: dict[str, float]


@dataclass(frozen=True, slots=True)
class AgreementStudy:
    """Agreement under two claims, and under the second with a part that the other half of the pairs of stations told.

    consistent    what scatters if nothing moves
    map           what is not known of where the wall is, by its unevenness
    systematic    what is not known of where the wall is, with the systematic part
    """

    consistent: Agreement
    map: Agreement
    systematic: Agreement


def study(
    stations: Iterable[tuple[str, Sequence[Scan]]],
    settings: ExtractionSettings | None = None,
    *,
    calibrated: bool = True,
    tell: Callable[[int], None] = lambda pairs: None,
) -> AgreementStudy:
    """Compare neighbouring stations (name, scans), each with the noise that its own first half tells.

    Every second pair of stations tells the systematic part that the others are judged with, and the other way round.
    Stations that do not show the same place are no neighbours. Raises EvaluationError if fewer than two pairs are.
    """
    settings = settings or ExtractionSettings()
    groups: dict[str, dict[Covariance, list[Pair]]] = {}
    prepared = (_prepared(name, scans, settings, calibrated) for name, scans in stations)
    for first, second in pairwise(prepared):
        group = _pairs(first, second)
        if group is not None:
            groups[f"{first.name} - {second.name}"] = group
            tell(len(groups))
    if len(groups) < _LEAST_PAIRS:
        raise EvaluationError(
            "Agreement needs a sensor that stood still at three places or more, each in view of the one before; "
            f"there are {len(groups)} such pairs of neighbours here."
        )
    names, pairs = list(groups), [group["map"] for group in groups.values()]
    halves = (systematic_part(pairs[1::2]), systematic_part(pairs[::2]))
    return AgreementStudy(
        _judged(names, [group["consistent"] for group in groups.values()], (0.0,)),
        _judged(names, pairs, (0.0,)),
        _judged(names, pairs, halves),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Station:
    name: str
    middle: Scan
    feature_sets: dict[Covariance, list[FeatureSet]]


def _prepared(name: str, scans: Sequence[Scan], settings: ExtractionSettings, calibrated: bool) -> _Station:
    """A station with the features of scans spread over the second half of its scans."""
    half = len(scans) // 2
    chosen = replace(settings, noise=_calibrated(scans[:half], settings.noise)) if calibrated else settings
    at = np.linspace(half, len(scans) - 1, SCANS).astype(int).tolist()
    kinds: tuple[Covariance, ...] = ("consistent", "map")
    feature_sets = {
        kind: [FeatureSet.of(extract(scans[i], replace(chosen, covariance=kind))) for i in at]
        for kind in kinds
    }
    return _Station(name, scans[half], feature_sets)


def _calibrated(scans: Sequence[Scan], usual: SensorNoise) -> SensorNoise:
    try:
        return calibrate(scans).noise_or(usual)
    except EvaluationError:
        return usual


def _pairs(first: _Station, second: _Station) -> dict[Covariance, list[Pair]] | None:
    """Pairs of scans from both stations, one by one, by claim; None if the stations do not lie on each other."""
    registered = _registered(first.middle, second.middle)
    if registered.inliers < _INLIERS:
        return None
    return {
        kind: [Pair(a, b, registered.pose) for a, b in zip(sets, second.feature_sets[kind], strict=True)]
        for kind, sets in first.feature_sets.items()
    }


def _registered(reference: Scan, scan: Scan) -> Registration:
    """How a scan lies on one that was taken nearby."""
    settings, nowhere = MatchSettings(), np.zeros(3)
    A, B = patches(reference, settings), patches(scan, settings)
    start = search(A.means, B.means, nowhere, _APART, settings)
    elements = surfels(A, settings.patch, settings.reach)
    return register(elements, B, start, nowhere, information_of(np.diag(_APART**2)), settings.reach)


def _judged(names: list[str], groups: list[list[Pair]], parts: tuple[float, ...]) -> Agreement:
    """parts: the systematic part of each pair of stations in turn."""
    found = [[differences(pair, parts[i % len(parts)]) for pair in group] for i, group in enumerate(groups)]
    walls = [[d.walls for d in each] for each in found]
    shares = {
        name: float((np.concatenate(each) <= GATE).mean())
        for name, each in zip(names, walls, strict=True)
        if sum(map(len, each))
    }
    return Agreement(
        parts,
        _share(found, "walls"),
        _share(found, "corners"),
        sum(len(d) for each in walls for d in each),
        shares,
    )


def _share(found: list[list[Differences]], what: str) -> Interval:
    joined = [np.concatenate([getattr(d, what) for d in each]) for each in found]
    hits = np.array([(d <= GATE).sum() for d in joined], np.float64)
    return share(hits, np.array([len(d) for d in joined], np.float64))
