"""Means over independent runs, and how well they are known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

LEVEL = 0.95


@dataclass(frozen=True, slots=True)
class Interval:
    """A mean over runs with its confidence interval by Student's t; infinite if there was one run only."""

    mean: float
    half_width: float

    @classmethod
    def of(cls, values: ArrayLike) -> "Interval":
        """Of values (R,), one for each run."""
        x = np.asarray(values, np.float64)
        if len(x) < 2:
            return cls(float(x.mean()), float("inf"))
        t = float(stdtrit(len(x) - 1, (1 + LEVEL) / 2))
        return cls(float(x.mean()), t * float(x.std(ddof=1)) / len(x) ** 0.5)

    @property
    def low(self) -> float:
        """Lower end."""
        return self.mean - self.half_width

    @property
    def high(self) -> float:
        """Upper end."""
        return self.mean + self.half_width

    def contains(self, value: float) -> bool:
        """Whether the runs are compatible with this value of the mean."""
        return self.low <= value <= self.high

    def text(self, digits: int, factor: float = 1.0) -> str:
        """'1.23 ± 0.04', or the mean alone if its error is not known."""
        mean = f"{factor * self.mean:.{digits}f}".replace("-", "−")
        return f"{mean} ± {factor * self.half_width:.{digits}f}" if np.isfinite(self.half_width) else mean
