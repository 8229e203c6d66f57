"""Many sightings of a corner made into one, as a filter does it that has nothing else to do."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice

import numpy as np

from lidarcore.evaluation.consistency_design import KINDS, room
from lidarcore.evaluation.intervals import Interval, ratio, share
from lidarcore.evaluation.places import places
from lidarcore.evaluation.trials import simulate
from lidarcore.experiments.corner_study import Method
from lidarcore.experiments.paper_rooms import BEAMS
from lidarcore.guide.views import GATE, Situation
from lidarcore.lines import FITTERS
from lidarcore.scan import Array, Ints
from lidarcore.settings import ExtractionSettings


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


def fuse(errors: Array, claims: Array) -> tuple[Array, Array]:
    """Errors (P, K, 2) with claims (P, K, 2, 2) made into one each, (P, 2) and (P, 2, 2): weighed by inverse claims."""
    information = np.linalg.inv(claims)
    C = np.linalg.inv(information.sum(1))
    e: Array = np.einsum("pij,pkjl,pkl->pi", C, information, errors)
    return e, C


def _figures(errors: Array, claims: Array, of_place: Ints) -> Fused:
    e, C = fuse(errors, claims)
    nees = np.einsum("pi,pi->p", e, np.linalg.solve(C, e[..., None])[..., 0])

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
