"""Which studies there are: what each asks, what can be chosen, and the command that runs it."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from lidarcore import SensorNoise

QUICK_TRIALS, FULL_TRIALS = 100_000, 1_000_000
QUICK_SCANS = 100  # of a recording; of a room the command knows

Noise = Literal["usual", "settings"]
Seed = Annotated[int, Field(ge=0, le=2**31 - 1, description="seed of the random numbers")]
Quick = Annotated[bool, Field(description="a quick run: wider intervals in a fraction of the time")]


class Options(BaseModel, ABC):
    """What can be chosen of every study."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)
    quick: Quick = True
    seed: Seed = 0

    @abstractmethod
    def arguments(self, noise: SensorNoise, path: Callable[[str], Path]) -> list[str]:
        """Arguments of the command, with the noise set now, and where a recording is."""


class CornerOptions(Options):
    """Options of the papers on corners."""

    scans: int | None = Field(
        None,
        ge=10,
        le=20_000,
        description="of each room, or of the recording; as many as `quick` says if none",
    )
    noise: Noise = Field(
        "usual", description="that the methods assume: usual is the papers', settings the current one"
    )
    recording: str | None = Field(
        None, max_length=200, description="of a sensor at rest, in place of the simulated rooms"
    )
    topic: str | None = Field(None, max_length=200, description="which lidar, if the recording has several")

    def arguments(self, noise: SensorNoise, path: Callable[[str], Path]) -> list[str]:
        scans = QUICK_SCANS if self.scans is None and self.quick and self.recording else self.scans
        recording = None if self.recording is None else path(self.recording).absolute()
        set_now = self.noise == "settings"
        return _arguments(
            quick=self.quick,
            scans=scans,
            recording=recording,
            topic=self.topic,
            sigma_range=noise.sigma_range if set_now else None,
            sigma_bearing=noise.sigma_bearing if set_now else None,
        )


class DriveOptions(Options):
    """Options of the paper on clusters and the Kalman filter."""

    runs: int | None = Field(
        None, ge=1, le=200, description="drives along each trajectory; as many as `quick` says if none"
    )

    def arguments(self, noise: SensorNoise, path: Callable[[str], Path]) -> list[str]:
        return _arguments(quick=self.quick, runs=self.runs)


class ConsistencyOptions(Options):
    """Options of the study of consistency."""

    trials: int | None = Field(
        None,
        ge=1000,
        le=20_000_000,
        description="corners simulated in all, rounded up to whole blocks; as many as `quick` says if none",
    )
    noise: Noise = Field(
        "usual", description="usual runs through 1, 2, 3 and 5 cm; settings takes the current one"
    )

    def arguments(self, noise: SensorNoise, path: Callable[[str], Path]) -> list[str]:
        trials = self.trials or (QUICK_TRIALS if self.quick else FULL_TRIALS)
        set_now = f"{noise.sigma_range},{noise.sigma_bearing}" if self.noise == "settings" else None
        return _arguments(trials=trials, noise=set_now)


def _arguments(*, quick: bool = False, **options: object) -> list[str]:
    """Arguments of the command: --name=value of each option that is not None."""
    given = {name.replace("_", "-"): value for name, value in options.items() if value is not None}
    return ["--quick"] * quick + [f"--{name}={value}" for name, value in given.items()]


@dataclass(frozen=True)
class Kind:
    """A study: its command, what it asks and does, its options with examples, and how long it takes, s, quick and full.

    The times were measured with one worker on a small machine; once it has run here, its own are known.
    """

    name: str
    command: tuple[str, ...]
    title: str
    question: str
    does: str
    options: type[Options]
    examples: tuple[dict[str, Any], ...]
    seconds: tuple[float, float]


KINDS = {
    kind.name: kind
    for kind in (
        Kind(
            "consistency",
            ("evaluate", "consistency"),
            "Which ellipses can be believed?",
            "How often does each method's ellipse hold the true corner, with both covariances, in simulated rooms "
            "where the truth is known?",
            "Which ellipses can be believed: corners simulated with known truth, by every method.",
            ConsistencyOptions,
            ({"quick": True}, {"trials": 50000, "noise": "settings"}),
            (25, 240),
        ),
        Kind(
            "cwlf",
            ("experiment", "cwlf"),
            "Conditional weighted linear fitting",
            "Is CWLF more certain of its corners than Arras and Siegwart's method, and faster, as its paper says?",
            "The experiment of the paper on CWLF, in simulated rooms or from a recording.",
            CornerOptions,
            ({"quick": True}, {"scans": 500, "noise": "settings"}),
            (8, 30),
        ),
        Kind(
            "wctls",
            ("experiment", "wctls"),
            "Weighted conformal total least squares",
            "Are the ellipses of WCTLS as small as its paper says, and do the corners keep to them?",
            "The experiment of the paper on WCTLS, in simulated rooms or from a recording.",
            CornerOptions,
            ({"quick": True}, {"quick": False, "seed": 7}),
            (6, 20),
        ),
        Kind(
            "clustering-ekf",
            ("experiment", "clustering-ekf"),
            "Clusters and the Kalman filter",
            "Which of four ways to cluster points makes the best landmarks, and what does the filter add, also when "
            "nothing is seen for a while?",
            "The experiment of the paper on clusters and the Kalman filter, simulated.",
            DriveOptions,
            ({"quick": True, "runs": 1},),
            (60, 1800),
        ),
    )
}
