"""Can the ellipses be believed? Monte Carlo over rooms, noises and places with known truth, for every method."""

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from lidarcore.arrays import Array
from lidarcore.evaluation.consistency.design import KINDS, Design, room
from lidarcore.evaluation.consistency.figures import FIGURES, SUMS, tally
from lidarcore.evaluation.consistency.places import Place, places
from lidarcore.evaluation.consistency.trials import Segmentation, simulate
from lidarcore.evaluation.intervals import Interval
from lidarcore.evaluation.workers import outcomes
from lidarcore.lines import FITTERS
from lidarcore.noise import SensorNoise
from lidarcore.settings import Covariance, ExtractionSettings

__all__ = ["ALL_ROOMS", "Consistency", "Design", "Row", "run_chunk", "study"]

ALL_ROOMS = "all"
_SLAB = 400  # corners judged at a time: what they need stays in the cache


@dataclass(frozen=True, slots=True)
class Row:
    """What came out for one method in one room (or `all`) at one noise; figures by their name in FIGURES."""

    room: str
    noise: SensorNoise
    segments: Segmentation
    fitter: str
    covariance: Covariance
    figures: dict[str, Interval]


@dataclass(frozen=True, slots=True, eq=False)
class Consistency:
    """A finished study. sums (rooms, noises, blocks, segmentations, fitters, kinds, SUMS)."""

    design: Design
    sums: Array

    @property
    def trials(self) -> int:
        """Corner trials made."""
        return int(self.sums[..., 0, 0, SUMS.index("trials")].sum())

    def rows(self) -> Iterator[Row]:
        """The figures of every method in every room, and in all rooms together if there are several."""
        for r, name in enumerate(self.design.rooms):
            yield from self._rows(name, self.sums[r])
        if len(self.design.rooms) > 1:
            yield from self.pooled()

    def pooled(self) -> Iterator[Row]:
        """The figures of every method in all rooms together."""
        name = ALL_ROOMS if len(self.design.rooms) > 1 else self.design.rooms[0]
        return self._rows(name, self.sums.sum(0))

    def row(
        self, room: str, noise: SensorNoise, segments: Segmentation, fitter: str, covariance: Covariance
    ) -> Row:
        """The figures of one method in one room. Raises KeyError if they are not in the study."""
        wanted = (room, noise, segments, fitter, covariance)
        for row in self.rows():
            if (row.room, row.noise, row.segments, row.fitter, row.covariance) == wanted:
                return row
        raise KeyError(wanted)

    def _rows(self, name: str, sums: Array) -> Iterator[Row]:
        design = self.design
        cells = product(
            enumerate(design.noises), enumerate(design.segmentations), enumerate(FITTERS), enumerate(KINDS)
        )
        for (n, noise), (s, segments), (f, fitter), (k, kind) in cells:
            blocks = sums[n, :, s, f, k]
            figures = {figure.name: figure.of(blocks) for figure in FIGURES.values()}
            yield Row(name, noise, segments, fitter, kind, figures)


def study(
    design: Design,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] = lambda done, chunks: None,
) -> Consistency:
    """Run the study; the numbers depend on the design only.

    `workers` processes, or the workers of the Dask scheduler at this address. `progress` is told how many chunks
    are done, of how many.
    Raises EvaluationError if no scheduler answers.
    """
    finished: dict[int, Array] = {}
    progress(0, design.chunks)
    with closing(outcomes(partial(run_chunk, design), range(design.chunks), workers, scheduler)) as made:
        for number, sums in made:
            finished[number] = sums
            progress(len(finished), design.chunks)
    ordered = np.array([finished[number] for number in range(design.chunks)])
    return Consistency(
        design, ordered.reshape(len(design.rooms), len(design.noises), design.blocks, *design.shape)
    )


def run_chunk(design: Design, number: int) -> Array:
    """The sums of one block of one room and noise: the same wherever and whenever it is run."""
    r, n, _ = np.unravel_index(number, (len(design.rooms), len(design.noises), design.blocks))
    noise = design.noises[n]
    settings = ExtractionSettings(noise=noise)
    wandering, shaking = np.random.SeedSequence(design.seed, spawn_key=(number,)).spawn(2)
    seen = places(room(design.rooms[r]), noise, design.beams, np.random.default_rng(wandering))
    # Every segmentation is shown the same scans.
    rngs = [np.random.default_rng(shaking) for _ in design.segmentations]
    sums = np.zeros(design.shape)
    for slab in _slabs(seen, design.corners):
        for s, (segmentation, rng) in enumerate(zip(design.segmentations, rngs, strict=True)):
            trials = simulate(slab, segmentation, settings, design.draws, rng)
            for (f, fitter), (k, kind) in product(enumerate(FITTERS), enumerate(KINDS)):
                sums[s, f, k] += tally(trials[fitter, kind])
    return sums


def _slabs(seen: Iterator[Place], corners: int) -> Iterator[list[Place]]:
    """Places with so many corners in all, in lists of about _SLAB corners."""
    while corners > 0:
        slab, n = list[Place](), 0
        while n < min(_SLAB, corners):
            slab.append(next(seen).upto(corners - n))
            n += len(slab[-1].corners)
        yield slab
        corners -= n
