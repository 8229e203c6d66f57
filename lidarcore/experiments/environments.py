"""What the experiments of [CWLF] and [WCTLS] look at: two rooms each, or a recording."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from lidarcore.arrays import Array
from lidarcore.evaluation.consistency.trials import SEGMENTATIONS, Segmentation
from lidarcore.evaluation.workers import run_all
from lidarcore.experiments.claim_rules import RULES
from lidarcore.experiments.corner_study import CornerStudy, recorded, simulated
from lidarcore.experiments.paper_rooms import BEAMS, NOISE, Room
from lidarcore.geometry import unit_vectors
from lidarcore.noise import SensorNoise
from lidarcore.scan import Scan
from lidarcore.settings import ExtractionSettings

QUICK_SCANS = 100
_OF_PAPERS = (
    "The 50 mm are the papers'. Of the bearing they give the resolution, 0.391°; half of it is assumed."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """How an experiment is run: so many scans of each room, with the noise that every method is told.

    split_threshold (m) is that of the paper, for the real segmentation. assumed names what of the noise nobody gave.
    """

    seed: int = 0
    scans: int = 2000
    noise: SensorNoise = field(default_factory=lambda: NOISE)
    split_threshold: float = 0.05
    assumed: tuple[str, ...] = ("range", "bearing")

    def with_noise(self, sigma_range: float | None, sigma_bearing: float | None) -> "Design":
        """This design with noise (m, rad) of a sensor; None keeps its own. Raises ValueError as SensorNoise."""
        given = {"range": sigma_range, "bearing": sigma_bearing}
        noise = SensorNoise(
            self.noise.sigma_range if sigma_range is None else sigma_range,
            self.noise.sigma_bearing if sigma_bearing is None else sigma_bearing,
        )
        return replace(self, noise=noise, assumed=tuple(name for name, of in given.items() if of is None))

    @property
    def assumption(self) -> str:
        """What noise is assumed of a sensor that nobody described, and what to do; nothing if all was given."""
        values = {
            "range": f"{1e3 * self.noise.sigma_range:g} mm of range noise (--sigma-range)",
            "bearing": f"{1e3 * self.noise.sigma_bearing:.3g} mrad of bearing noise (--sigma-bearing)",
        }
        what = " and ".join(values[name] for name in self.assumed)
        return what and (
            f"Assumed, not measured: {what}. All ellipses depend on it. "
            "Measure the noise of the sensor with the command lidarcore calibrate and give it with these options."
        )

    @property
    def settings(self) -> ExtractionSettings:
        """Settings of the extraction."""
        return ExtractionSettings(noise=self.noise, split_threshold=self.split_threshold)

    def quick(self) -> "Design":
        """This design with few scans, to try it out."""
        return replace(self, scans=QUICK_SCANS)


@dataclass(frozen=True, eq=False)
class Environment:
    """A room or a recording, and what came out.

    room   None for a recording
    points (N, 2) m, one scan, sensor frame: without noise if simulated
    study  of a room with segments known, of a recording with those that extraction finds
    found  of a room, with the segments that extraction finds; None for a recording
    """

    name: str
    room: Room | None
    points: Array
    study: CornerStudy
    found: CornerStudy | None


def look_around(
    rooms: Sequence[Room],
    fitters: Sequence[str],
    design: Design,
    workers: int,
    recording: Sequence[Scan] | None,
    done: Callable[[], None],
) -> list[Environment]:
    """Simulate every room, or take a recording of a sensor at rest in their place.

    `done` is called twice for each room. Numbers depend on the design only. Raises EvaluationError if the recording
    cannot be used.
    """
    if recording is not None:
        study = recorded(recording, design.settings, fitters)
        points = recording[0].xy[recording[0].valid]
        return [Environment("the recording", None, points, study, None)]
    tasks = [(r, segmentation) for r in range(len(rooms)) for segmentation in SEGMENTATIONS]
    studies = run_all(partial(_study, tuple(rooms), design), tasks, workers, done)
    environments = []
    for room, known, found in zip(rooms, studies[::2], studies[1::2], strict=True):
        place = room.place(design.noise)
        points = place.ranges[:, None] * unit_vectors(place.bearings)
        environments.append(Environment(room.name, room, points, known, found))
    return environments


def _study(rooms: Sequence[Room], design: Design, task: tuple[int, Segmentation]) -> CornerStudy:
    r, segmentation = task
    # Both segmentations are shown the same scans.
    return simulated(
        rooms[r].place(design.noise), segmentation, design.settings, design.scans, [design.seed, r]
    )


def of_verdicts(design: Design, simulated_rooms: bool) -> list[str]:
    """Sentences that say by what rules claims are judged and, of a recording, which noise is assumed."""
    return [RULES, *([design.assumption] if design.assumption and not simulated_rooms else [])]


def set_up(design: Design, environments: Sequence[Environment]) -> list[str]:
    """What was simulated, or recorded, in sentences."""
    noise = design.noise
    told = (
        f"Every method is told {1e3 * noise.sigma_range:g} mm and {np.degrees(noise.sigma_bearing):.3g}° of noise, as "
        "independent Gaussian errors of range and bearing."
    )
    if environments[0].room is None:
        study = environments[0].study
        return [
            f"{study.scans} scans of a recording, the sensor at rest; corners: {len(study.corners)}. There is no "
            "truth: errors are those from the mean over all scans, so that a "
            "bias common to all does not show. What the paper has of its own rooms and of times is left out: it is "
            "not in the recording.",
            f"{told} {design.assumption}".rstrip(),
        ]
    rooms = "; ".join(
        f"{e.name}, {e.room.size} with pillars, niches and cabinets, {e.room.sections} pieces of wall and "
        f"{e.room.corners} corners in view"
        for e in environments
        if e.room
    )
    return [
        f"The papers' scans are not public. Rooms of their sizes and numbers of corners are simulated: {rooms}.",
        f"{told} {_OF_PAPERS}" if noise == NOISE else told,
        f"Of each room {design.scans} scans of {BEAMS} beams (0.391°) from one place, seed {design.seed}. "
        "Segments known: every beam is of the wall it truly met. Found: by iterative end point fit, threshold "
        f"{1e3 * design.split_threshold:g} mm as in the paper, and more where noise explains more; with noise of that "
        "size, small walls merge with others, and corners are lost. Tables are of known segments, so that they show "
        "the formulas alone; claims are those of the scan with the median ellipse.",
        "The scatter is the RMS error over all scans, about the truth. Least possible is the Cramér-Rao bound.",
    ]
