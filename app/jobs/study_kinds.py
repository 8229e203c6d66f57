"""Which studies there are: what each asks, what can be chosen, and the command that runs it."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

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
        return [
            *(["--quick"] if self.quick else []),
            *([f"--scans={scans}"] if scans is not None else []),
            *([f"--recording={path(self.recording).absolute()}"] if self.recording is not None else []),
            *([f"--topic={self.topic}"] if self.topic is not None else []),
            *(
                [f"--sigma-range={noise.sigma_range}", f"--sigma-bearing={noise.sigma_bearing}"]
                if self.noise == "settings"
                else []
            ),
        ]


class DriveOptions(Options):
    """Options of the paper on clusters and the Kalman filter."""

    runs: int | None = Field(
        None, ge=1, le=200, description="drives along each trajectory; as many as `quick` says if none"
    )

    def arguments(self, noise: SensorNoise, path: Callable[[str], Path]) -> list[str]:
        runs = [f"--runs={self.runs}"] if self.runs is not None else []
        return [*(["--quick"] if self.quick else []), *runs]


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
        noise_arguments = (
            [f"--noise={noise.sigma_range},{noise.sigma_bearing}"] if self.noise == "settings" else []
        )
        return [f"--trials={trials}", *noise_arguments]


@dataclass(frozen=True)
class Kind:
    """A study: its command, what it asks, its options, and about how long it takes, s, quick and in full.

    The times were measured with one worker on a small machine; once it has run here, its own are known.
    """

    name: str
    command: tuple[str, ...]
    title: str
    question: str
    options: type[Options]
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
            ConsistencyOptions,
            (25, 240),
        ),
        Kind(
            "cwlf",
            ("experiment", "cwlf"),
            "Conditional weighted linear fitting",
            "Is CWLF more certain of its corners than Arras and Siegwart's method, and faster, as its paper says?",
            CornerOptions,
            (8, 30),
        ),
        Kind(
            "wctls",
            ("experiment", "wctls"),
            "Weighted conformal total least squares",
            "Are the ellipses of WCTLS as small as its paper says, and do the corners keep to them?",
            CornerOptions,
            (6, 20),
        ),
        Kind(
            "clustering-ekf",
            ("experiment", "clustering-ekf"),
            "Clusters and the Kalman filter",
            "Which of four ways to cluster points makes the best landmarks, and what does the filter add, also when "
            "nothing is seen for a while?",
            DriveOptions,
            (60, 1800),
        ),
    )
}
