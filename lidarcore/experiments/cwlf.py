"""The experiment of [CWLF]: corners by Arras-Siegwart and by conditional weighted linear fitting.

[CWLF]: N. Prieto-Fernández et al., Conditional Weighted Linear Fitting for 2D-LiDAR-Mapping of Indoor SLAM,
IEEE Transactions on Industrial Informatics 20(7), 2024. Its tables I and II and figures 3 to 5.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from lidarcore.experiments import cwlf_timing as timing
from lidarcore.experiments.cwlf_timing import Times, Uncertainty
from lidarcore.experiments.environments import Design, Environment, look_around
from lidarcore.experiments.paper_rooms import CWLF_ROOMS
from lidarcore.scan import Scan

FITTERS = ("arras_siegwart", "cwlf")
COMPARED = (50, 100)  # measurements in figures 4 and 5
MEASUREMENTS = (10, 20, 30, 50, 70, 90, 100, 150, 200, 300, 500)  # in figure 3
PARTS = 2 * len(CWLF_ROOMS) + 1  # that `run` tells of


@dataclass(frozen=True, eq=False)
class CwlfStudy:
    """All that was measured; of a recording there are environments only.

    times          of the chosen corner of the first room by fitter and number of measurements: figure 3
    step_times     by room, fitter and number of measurements: figures 4 and 5
    uncertainties  likewise
    """

    design: Design
    environments: Sequence[Environment]
    times: dict[tuple[str, int], Times]
    step_times: dict[tuple[str, str, int], Times]
    uncertainties: dict[tuple[str, str, int], Uncertainty]


def run(
    design: Design,
    workers: int = 1,
    recording: Sequence[Scan] | None = None,
    done: Callable[[], None] = lambda: None,
) -> CwlfStudy:
    """The whole experiment, or with a recording what can be told of it: all but the chosen corners and the times.

    All but the times is the same for the same design, whatever the number of workers.
    Raises EvaluationError if the recording cannot be used.
    """
    environments = look_around(CWLF_ROOMS, FITTERS, design, workers, recording, done)
    if recording is not None:
        result = CwlfStudy(design, environments, {}, {}, {})
    else:
        result = _with_chosen_corners(design, environments)
    done()
    return result


def _with_chosen_corners(design: Design, environments: Sequence[Environment]) -> CwlfStudy:
    noise, repeats, draws = design.noise, min(design.scans // 5, 50), design.scans
    growing = {n: timing.walls_of(CWLF_ROOMS[0], noise, n) for n in MEASUREMENTS}
    cells = [
        (room.name, name, n, timing.walls_of(room, noise, n))
        for room in CWLF_ROOMS
        for name in FITTERS
        for n in COMPARED
    ]
    return CwlfStudy(
        design,
        environments,
        {
            (name, n): timing.times(name, walls, noise, repeats)
            for n, walls in growing.items()
            for name in FITTERS
        },
        {(room, name, n): timing.times(name, walls, noise, repeats) for room, name, n, walls in cells},
        {
            (room, name, n): timing.uncertainty(name, walls, noise, draws, [design.seed, n])
            for room, name, n, walls in cells
        },
    )
