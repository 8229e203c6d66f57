"""Figures 3 to 5 of [CWLF]: one corner of more and more measurements, uncertainty and time of the four steps."""

import timeit
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from lidarcore.arrays import Array
from lidarcore.corners import intersect
from lidarcore.evaluation.consistency.cramer_rao import corner_bound
from lidarcore.experiments.cwlf_steps import METHODS, Beams, corner
from lidarcore.experiments.paper_rooms import Room
from lidarcore.lines import FITTER_IDS, FITTERS, LINE_FIELDS, fit_beams
from lidarcore.noise import SensorNoise
from lidarcore.tables import CORNER_FIELDS


@dataclass(frozen=True, slots=True, eq=False)
class Uncertainty:
    """Standard deviations of x and y (2,) m of one corner: as published, as it scatters, and the least possible."""

    published: Array
    scatter: Array
    bound: Array


@dataclass(frozen=True, slots=True)
class Times:
    """Best times (µs) of the four STEPS in numpy, and of the library's compiled fit of both walls and corner."""

    steps: tuple[float, ...]
    library: float

    @property
    def total(self) -> float:
        """µs, of all steps."""
        return sum(self.steps)


def walls_of(room: Room, noise: SensorNoise, measurements: int) -> tuple[Beams, Beams]:
    """True beams on the two walls of the chosen corner, half of them on each, evenly spread over what is in view."""
    place, k = room.place(noise), room.chosen_corner()
    walls = []
    for first, count in zip(place.first[k], place.count[k], strict=True):
        start, stop = np.unwrap(place.bearings[[first, first + count - 1]]).tolist()
        bearings = np.linspace(start, stop, measurements // 2)
        walls.append((room.world.cast(np.array(room.pose), bearings)[0], bearings))
    return walls[0], walls[1]


def uncertainty(
    method: str, walls: tuple[Beams, Beams], noise: SensorNoise, draws: int, seed: list[int]
) -> Uncertainty:
    """Uncertainty of the corner between true walls, seen `draws` times."""
    rng = np.random.default_rng(seed)
    truth, published = corner(METHODS[method], walls, noise)
    errors = []
    for _ in range(draws):
        seen = _noisy(walls[0], noise, rng), _noisy(walls[1], noise, rng)
        errors.append(corner(METHODS[method], seen, noise)[0] - truth)
    lines = [FITTERS["ml"].fit(*wall, noise) for wall in walls]
    (j, k), (first, second) = ((line.alpha, line.r) for line in lines), (wall[1] for wall in walls)
    bound = corner_bound((j, k), (first, second), noise)
    return Uncertainty(
        np.sqrt(np.diag(published)), np.sqrt(np.mean(np.square(errors), axis=0)), np.sqrt(np.diag(bound))
    )


def _noisy(wall: Beams, noise: SensorNoise, rng: np.random.Generator) -> Beams:
    rho, theta = wall
    n = len(rho)
    return rho + rng.normal(0, noise.sigma_range, n), theta + rng.normal(0, noise.sigma_bearing, n)


def times(name: str, walls: tuple[Beams, Beams], noise: SensorNoise, repeats: int) -> Times:
    """Each step on its own, the best of `repeats`."""
    method = METHODS[name]
    j, k = (method.line(wall, noise) for wall in walls)
    cj, ck = (method.line_covariance(line, noise) for line in (j, k))
    xy = method.corner(j, k)
    steps: tuple[Callable[[], object], ...] = (
        lambda: [method.line(wall, noise) for wall in walls],
        lambda: [method.line_covariance(line, noise) for line in (j, k)],
        lambda: method.corner(j, k),
        lambda: method.corner_covariance(j, k, xy, cj, ck),
    )
    library = partial(_compiled, FITTER_IDS[name], walls, noise)
    return Times(tuple(_best(step, repeats) for step in steps), _best(library, repeats))


def _compiled(fitter: int, walls: tuple[Beams, Beams], noise: SensorNoise) -> Array:
    rows, out = np.empty((2, LINE_FIELDS)), np.empty(CORNER_FIELDS)
    for row, (rho, theta) in zip(rows, walls, strict=True):
        fit_beams(fitter, rho, theta, noise.model(), row)
    intersect(rows[0], rows[1], out)
    return out


def _best(call: Callable[[], object], repeats: int) -> float:
    call()
    return 1e6 * min(timeit.repeat(call, number=5, repeat=repeats)) / 5
