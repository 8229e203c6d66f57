"""What a study of consistency runs through: rooms, noises, segmentations, numbers of trials."""

import math
from functools import lru_cache
from typing import Annotated

import pydantic.dataclasses
from pydantic import ConfigDict, Field, field_validator

from lidarcore.errors import EvaluationError
from lidarcore.evaluation.consistency.figures import SUMS
from lidarcore.evaluation.consistency.trials import SEGMENTATIONS, Segmentation
from lidarcore.lines import FITTERS
from lidarcore.noise import SensorNoise
from lidarcore.settings import Covariance
from lidarcore.simulation.rooms import rectangular_room
from lidarcore.simulation.world import World
from lidarcore.simulation.worlds import WORLDS

KINDS: tuple[Covariance, ...] = ("published", "consistent")
ROOMS = tuple(name for name, place in WORLDS.items() if place.posts is None)  # and any "4.5x2.5"
_SIDES = (1.5, 100.0)  # m, of a rectangular room


@pydantic.dataclasses.dataclass(config=ConfigDict(extra="forbid"), frozen=True, kw_only=True)
class Design:
    """What a study runs through: every room with every noise. Equal designs give equal numbers.

    Of `trials` corner trials in all, each is one corner of one noisy scan, estimated by every fitter. From each
    random place `draws` scans are taken. `blocks` are independent, and what confidence intervals are made of.
    """

    rooms: Annotated[tuple[str, ...], Field(min_length=1)] = ("4.5x2.5", "18x9", "furnished room")
    noises: Annotated[tuple[SensorNoise, ...], Field(min_length=1)] = tuple(
        SensorNoise(sigma, 0.001) for sigma in (0.01, 0.02, 0.03, 0.05)
    )
    segmentations: Annotated[tuple[Segmentation, ...], Field(min_length=1)] = SEGMENTATIONS
    trials: Annotated[int, Field(ge=1)] = 100_000
    draws: Annotated[int, Field(ge=2, le=1000)] = 10
    blocks: Annotated[int, Field(ge=2, le=1000)] = 40
    beams: Annotated[int, Field(ge=90, le=100_000)] = 920
    seed: Annotated[int, Field(ge=0)] = 0

    @field_validator("rooms")
    @classmethod
    def _known_rooms(cls, rooms: tuple[str, ...]) -> tuple[str, ...]:
        for name in rooms:
            room(name)
        return rooms

    @property
    def chunks(self) -> int:
        """Number of parts that are worked on one by one: a block of one room and noise."""
        return len(self.rooms) * len(self.noises) * self.blocks

    @property
    def corners(self) -> int:
        """Number of corners in a block, each seen `draws` times with every segmentation."""
        return math.ceil(self.trials / (self.chunks * len(self.segmentations) * self.draws))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the sums of one chunk: segmentations, fitters, kinds of covariance, sums."""
        return len(self.segmentations), len(FITTERS), len(KINDS), len(SUMS)


@lru_cache
def room(name: str) -> World:
    """A simulated world by its name, or a rectangle in m, '4.5x2.5'. Raises EvaluationError if it is neither."""
    if name in ROOMS:
        return WORLDS[name].world
    try:
        length, width = map(float, name.lower().split("x"))
        inside = all(_SIDES[0] <= side <= _SIDES[1] for side in (length, width))
    except ValueError:
        inside = False
    if not inside:
        raise EvaluationError(
            f"There is no room {name!r}: choose one of {', '.join(ROOMS)}, or a rectangle such as 4.5x2.5, "
            f"with sides of {_SIDES[0]:g} to {_SIDES[1]:g} m."
        )
    return rectangular_room(length, width)
