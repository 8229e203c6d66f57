"""What a study of calibrations runs through: rooms, noise, and how uneven walls are."""

from dataclasses import replace
from itertools import product
from typing import Annotated

import numpy as np
import pydantic.dataclasses
from pydantic import ConfigDict, Field

from lidarcore.noise import SensorNoise

PARTS = {
    "sigma_range": (1e3, "mm"),
    "range_growth": (1e3, "mm/m²"),
    "sigma_bearing": (1e3, "mrad"),
    "unevenness": (1e3, "mm"),
    "unevenness_length": (1e2, "cm"),
    "range_bias": (1e3, "mm"),
    "alignment": (180 / np.pi, "°"),
}
"""What a calibration gives an interval of: factor and unit to print it with."""
WITHOUT = {
    "tails": "a value of a list, without an interval; simulated errors are Gaussian",
    "renewal, resampling": "what a standing sensor repeats: it depends on segmentation, and no simulated number is the "
    "truth",
    "outliers, drift": "none are simulated",
}
"""What this study does not judge, and why."""


@pydantic.dataclasses.dataclass(config=ConfigDict(extra="forbid"), frozen=True, kw_only=True)
class Design:
    """What a study runs through: every unevenness (m) with every length (m) over which it is alike, and straight walls.

    `rooms` rooms are shared out among these cells, and in each among the places in `names`. A calibration has `scans`
    scans, or `fewer`; afterwards `views` places in the room are looked from.
    """

    rooms: Annotated[int, Field(ge=1, le=100_000)] = 200
    noise: SensorNoise = SensorNoise(0.002, 0.001, range_growth=0.0003)
    unevenness: tuple[float, ...] = (0.0, 0.002, 0.004, 0.008)
    lengths: Annotated[tuple[float, ...], Field(min_length=1)] = (0.03, 0.08, 0.2)
    names: Annotated[tuple[str, ...], Field(min_length=1)] = (
        "4.5x2.5", "18x9", "furnished room", "two rooms",
    )  # fmt: skip
    scans: Annotated[int, Field(ge=10, le=10_000)] = 60
    fewer: Annotated[int, Field(ge=10, le=10_000)] = 40
    views: Annotated[int, Field(ge=1, le=1000)] = 10
    seed: Annotated[int, Field(ge=0)] = 0

    def of(self, number: int) -> tuple[int, str]:
        """Which cell a room is of, and the name of its place."""
        again, cell = divmod(number, len(self.cells))
        return cell, self.names[again % len(self.names)]

    @property
    def cells(self) -> list[SensorNoise]:
        """The noise with each unevenness and length; straight walls have no length."""
        straight = [replace(self.noise, unevenness=0.0)] if 0 in self.unevenness else []
        sizes = [size for size in self.unevenness if size]
        return straight + [
            replace(self.noise, unevenness=size, unevenness_length=length)
            for size, length in product(sizes, self.lengths)
        ]
