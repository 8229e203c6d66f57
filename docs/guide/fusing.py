"""Many sightings of a corner made into one, as a filter does it that has nothing else to do."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice

import numpy as np

from lidarcore.evaluation.consistency.design import KINDS, room
from lidarcore.evaluation.consistency.places import places
from lidarcore.evaluation.consistency.trials import simulate
from lidarcore.evaluation.intervals import Interval, ratio, share
from lidarcore.experiments.corner_study import Method
from lidarcore.experiments.paper_rooms import BEAMS
from lidarcore.geometry import fuse, squared_mahalanobis
from lidarcore.lines import FITTERS
from lidarcore.scan import Array, Ints
from lidarcore.settings import ExtractionSettings

from .views import GATE, Situation


@dataclass(frozen=True, slots=True)
class Fused:
    """Corners fused from many sightings: RMS error and RMS claim, m; ANEES, and coverage of the 95 % ellipse."""

    error: Interval
    claimed: Interval
    anees: Interval
    coverage: Interval


def fused(situation: Situation, sightings: int, spots: int, seed: int) -> Mapping[Method, Fused]:
    """All corners seen from so many random places of the room, segments known, each from so many sightings."""
    rng = np.random.default_rng(seed)
    seen = list(islice(places(room(situation.room), situation.noise, BEAMS, rng), spots))
    trials = simulate(seen, "known", ExtractionSettings(noise=situation.noise), sightings, rng)
    of_place = np.repeat(np.arange(spots), [len(place.corners) for place in seen])
    return {
        (name, kind): _figures(trials[name, kind].errors, trials[name, kind].covariances, of_place)
        for name in FITTERS
        for kind in KINDS
    }


def _figures(errors: Array, claims: Array, of_place: Ints) -> Fused:
    e, C = fuse(errors, claims)
    nees = squared_mahalanobis(e, C)

    def summed(values: Array) -> Array:
        sums: Array = np.bincount(of_place, values).astype(np.float64)
        return sums

    ones = summed(np.ones(len(e)))
    return Fused(
        ratio(summed((e**2).sum(1)), ones).root(),
        ratio(summed(np.trace(C, axis1=1, axis2=2)), ones).root(),
        ratio(summed(nees), 2 * ones),
        share(summed((nees <= GATE).astype(np.float64)), ones),
    )
