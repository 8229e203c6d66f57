"""What can be set about finding a pose in a known map."""

from typing import Annotated

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from lidarcore.fields import number


@dataclass(config=ConfigDict(extra="forbid"), frozen=True, slots=True, kw_only=True)
class RelocationSettings:
    """When a pose is believed: what is seen is there, little speaks against it, and no other place does as well."""

    reach: float = number(
        0.02, 1.0, "m", "how far beside what stands a point still fits, as a sigma", default=0.1
    )
    spacing: float = number(0.02, 1.0, "m", "points closer together than this count once", default=0.15)
    most_points: Annotated[
        int, Field(ge=20, le=2000, description="points that are matched to the map at most")
    ] = 150
    least_points: Annotated[
        int, Field(ge=5, le=2000, description="with fewer points nothing is looked for")
    ] = 25
    max_range: float = number(1.0, 200.0, "m", "returns from farther away are left out", default=20.0)
    fit: float = number(
        0.1,
        1.0,
        "",
        "least share of the points that fit the map, by rays that it does not contradict",
        default=0.65,
    )
    against: float = number(
        0.0,
        1.0,
        "",
        "a rival is a place where the map contradicts this share of the rays more, at most",
        default=0.15,
    )
    rival: float = number(
        0.1, 1.0, "", "share of the best fit from which another place is a rival", default=0.85
    )
