"""Everything the guide says is measured here, once, from one seed."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from lidarcore.evaluation.consistency.design import Design
from lidarcore.evaluation.consistency.study import Consistency, study
from lidarcore.evaluation.consistency.trials import Segmentation
from lidarcore.evaluation.intervals import Interval
from lidarcore.experiments.corner_study import Method
from lidarcore.noise import SensorNoise
from lidarcore.settings import Covariance

from . import filters, fusing, mixing
from .views import SITUATIONS, CornerView, view
from .wall import WallView, wall_view

Figures = dict[str, Interval]
MIXED_NOISE = SensorNoise(0.02, 0.001)
WALL_FITTERS = ("cwlf", "wctls")
FED: tuple[Method, ...] = (
    ("cwlf", "published"), ("wctls", "published"),
    ("cwlf", "consistent"), ("wctls", "consistent"), ("ml", "consistent"),
)  # fmt: skip
"""Methods whose ellipses the filter is fed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GuideDesign:
    """How much is simulated: scans of the corner that is drawn, corner trials of each situation and of the table,
    sightings that are fused of the corners seen from so many spots, drives of so many steps, spots with mixed pixels.
    """

    seed: int = 0
    scans: int = 300
    trials: int = 80_000
    table_trials: int = 600_000
    sightings: int = 100
    spots: int = 200
    drives: int = 40
    steps: int = 60
    mixed_spots: int = 400
    table: Design = field(default_factory=Design)

    def quick(self) -> "GuideDesign":
        """The same with little of everything: it has wide intervals."""
        return replace(self, trials=6000, table_trials=40_000, spots=40, drives=5, mixed_spots=60)


@dataclass(frozen=True, eq=False)
class Measurement:
    """What came out; by name of the situation where it is of one.

    mixed   coverage of `ml` without mixed pixels, and with one at every step in range
    """

    design: GuideDesign
    views: Mapping[str, CornerView]
    wall: WallView
    studies: Mapping[str, Consistency]
    table: Consistency
    fused: Mapping[str, Mapping[Method, fusing.Fused]]
    filtered: Mapping[Method, filters.Filtered]
    mixed: tuple[Interval, Interval]

    @cached_property
    def by_method(self) -> dict[tuple[str, str, Covariance], Figures]:
        """Of the corners seen from random places, segments known: by situation, fitter and kind."""
        return {
            (name, row.fitter, row.covariance): row.figures
            for name, study in self.studies.items()
            for row in study.pooled()
        }

    @cached_property
    def by_noise(self) -> dict[tuple[SensorNoise, Segmentation, str, Covariance], Figures]:
        """The same of the table."""
        return {
            (row.noise, row.segments, row.fitter, row.covariance): row.figures for row in self.table.pooled()
        }


def measure(design: GuideDesign, workers: int = 1) -> Measurement:
    """A minute or two on two cores; equal designs give equal numbers."""
    seed = design.seed
    small = SITUATIONS["papers"]
    return Measurement(
        design,
        {name: view(case, design.scans, seed) for name, case in SITUATIONS.items()},
        wall_view(small, WALL_FITTERS, design.scans, seed),
        {
            name: study(
                Design(
                    rooms=(case.room,),
                    noises=(case.noise,),
                    segmentations=("known",),
                    trials=design.trials,
                    seed=seed,
                ),
                workers,
            )
            for name, case in SITUATIONS.items()
        },
        study(replace(design.table, trials=design.table_trials, seed=seed), workers),
        {
            name: fusing.fused(SITUATIONS[name], design.sightings, design.spots, seed)
            for name in ("papers", "exact")
        },
        filters.filtered(small, FED, design.drives, design.steps, seed),
        (
            mixing.covered(MIXED_NOISE, 0.0, design.mixed_spots, seed),
            mixing.covered(MIXED_NOISE, 1.0, design.mixed_spots, seed),
        ),
    )
