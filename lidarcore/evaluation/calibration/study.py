"""Do calibrations find what is so? Simulated rooms whose noise and walls are known, calibrated and judged."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from lidarcore.evaluation.calibration.design import PARTS, Design
from lidarcore.evaluation.calibration.trial import Trial, trial
from lidarcore.evaluation.intervals import Interval, mean, share
from lidarcore.evaluation.stations.study import Figures
from lidarcore.evaluation.workers import run_all
from lidarcore.noise import SensorNoise
from lidarcore.scan import Array


@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """The trials with one unevenness."""

    noise: SensorNoise
    trials: tuple[Trial, ...]

    def held(self, of: int) -> Interval:
        """How often ellipses for maps of walls (0) or corners (1) hold the truth; rooms are independent."""
        return share(*np.array([one.held[of] for one in self.trials]).T)

    def scatter(self, corners: bool) -> Figures | None:
        """Scatter of corners or walls against their claims, while the sensor stands still."""
        parts = [one.corners if corners else one.walls for one in self.trials]
        known = [part for part in parts if part is not None]
        return Figures.joined(known) if known else None


@dataclass(frozen=True, slots=True)
class Part:
    """One part of the noise over many rooms.

    held      how often its interval holds the truth
    told      how many rooms told it
    bias      mean of value minus truth, relative if the truth is not 0
    error     median and 90 % of the relative error from the fewer scans; None where the truth is 0
    """

    name: str
    held: Interval
    told: int
    bias: Interval
    error: tuple[float, float] | None


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationStudy:
    """A finished study."""

    design: Design
    cells: tuple[Cell, ...]

    @property
    def trials(self) -> list[Trial]:
        """Trials of all cells."""
        return [one for cell in self.cells for one in cell.trials]

    def parts(self, cell: Cell | None = None) -> Iterator[Part]:
        """The parts of the noise, over all rooms or over those of one cell."""
        trials = self.trials if cell is None else cell.trials
        for name in PARTS:
            found = _known(name, [(one.parts, one.truth) for one in trials])
            if found:
                yield _part(name, found, _known(name, [(one.fewer, one.truth) for one in trials]))

    @property
    def failures(self) -> list[str]:
        """Why rooms could not be calibrated."""
        return [one.failure for one in self.trials if one.failure is not None]


def study(design: Design, workers: int = 1, done: Callable[[], None] = lambda: None) -> CalibrationStudy:
    """Run the study; the numbers depend on the design only. `done` is called after each room."""
    trials = run_all(partial(trial, design), range(design.rooms), workers, done)
    cells = design.cells[: design.rooms]
    return CalibrationStudy(
        design, tuple(Cell(cell, tuple(trials[k :: len(design.cells)])) for k, cell in enumerate(cells))
    )


_Found = list[tuple[Interval, float]]


def _known(name: str, trials: list[tuple[dict[str, Interval | None], dict[str, float]]]) -> _Found:
    """Interval and truth, where there are both."""
    pairs = [(parts.get(name), truth.get(name)) for parts, truth in trials]
    return [(part, true) for part, true in pairs if part is not None and true is not None]


def _part(name: str, found: _Found, fewer: _Found) -> Part:
    hits = np.array([part.contains(true) for part, true in found], np.float64)
    off = np.array([part.value - true for part, true in found])
    errors = np.array([abs(part.value / true - 1) for part, true in fewer if true > 0])
    relative = name not in ("range_bias", "alignment")
    if relative:
        off = np.array([part.value / true - 1 for part, true in found if true > 0])
    quantiles: Array = np.quantile(errors, [0.5, 0.9]) if relative and len(errors) else np.array([])
    return Part(
        name,
        share(hits, np.ones(len(hits))),
        len(found),
        mean(off),
        (float(quantiles[0]), float(quantiles[1])) if len(quantiles) else None,
    )
