"""The experiment of [WCTLS]: corners by three ways of total least squares, and the ellipses they claim.

[WCTLS]: N. Prieto-Fernández et al., Enhancement of the Total Least Squares Method for Feature Extraction in 2D LiDAR
Mapped Environments, Computer Modeling in Engineering & Sciences 147(2), 2026. Its tables 1 and 2, figures 3 and 4.
"""

import timeit
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lidarcore.experiments.environments import Design, Environment, look_around
from lidarcore.experiments.paper_rooms import WCTLS_ROOMS
from lidarcore.lines import FITTER_IDS, LINE_FIELDS, fit_beams
from lidarcore.noise import SensorNoise
from lidarcore.scan import Scan

FITTERS = ("utls", "wtls", "wctls")
THRESHOLD = 0.04  # m, of the segmentation
POINTS = (50, 500)  # of the walls whose fit is timed
PARTS = 2 * len(WCTLS_ROOMS) + 1  # that `run` tells of


@dataclass(frozen=True, eq=False)
class WctlsStudy:
    """All that was measured.

    times   µs, of one compiled line fit with both covariances, by fitter and number of points; of a recording none
    """

    design: Design
    environments: Sequence[Environment]
    times: dict[tuple[str, int], float]


def run(
    design: Design,
    workers: int = 1,
    recording: Sequence[Scan] | None = None,
    done: Callable[[], None] = lambda: None,
) -> WctlsStudy:
    """The whole experiment, with a recording in place of the rooms, if one is given.

    All but the times is the same for the same design, whatever the number of workers.
    Raises EvaluationError if the recording cannot be used.
    """
    environments = look_around(WCTLS_ROOMS, FITTERS, design, workers, recording, done)
    points = POINTS if recording is None else ()
    times = {(name, n): _time_of_fit(name, design.noise, n) for name in FITTERS for n in points}
    result = WctlsStudy(design, environments, times)
    done()
    return result


def _time_of_fit(fitter: str, noise: SensorNoise, points: int) -> float:
    """Best time, µs."""
    bearings = np.linspace(-0.5, 0.8, points)
    ranges, row = 2 / np.cos(bearings), np.empty(LINE_FIELDS)

    def fit() -> int:
        return fit_beams(FITTER_IDS[fitter], ranges, bearings, noise.model(), row)

    fit()
    return 1e6 * min(timeit.repeat(fit, number=100, repeat=20)) / 100
