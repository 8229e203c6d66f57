"""What a user can set about extraction: declared once, with unit, range and meaning.

Command line, REST, page and documentation derive from these declarations.
"""

from dataclasses import field
from typing import Annotated, Literal

from pydantic import Field, field_validator

from lidarcore.fields import number, plainly, settings, whole
from lidarcore.lines import FITTERS
from lidarcore.noise import SensorNoise

Covariance = Literal["consistent", "published", "map"]


@plainly
@settings
class ExtractionSettings:
    """How a scan becomes segments and corners. Metres and radians; immutable, so a scan never sees a half change.

    Raises pydantic.ValidationError, a ValueError that names the field and its bounds.
    """

    fitter: Annotated[
        str, Field(description="line fitting method", json_schema_extra={"enum": list(FITTERS)})
    ] = "ml"
    covariance: Annotated[Covariance, Field(description="which covariance `covariance` means")] = "consistent"
    noise: SensorNoise = field(default_factory=SensorNoise)
    latent_bearings: Annotated[
        bool,
        Field(description="ml looks for each beam's true bearing: without bias at grazing incidence"),
    ] = True
    split_threshold: float = number(
        0.005,
        1.0,
        "m",
        "a piece is split where a point is farther from its chord than this and than noise explains; where the "
        "unevenness of walls is given, noise and unevenness decide alone. More: fewer, longer walls",
        default=0.05,
    )
    gap: float = number(
        0.02,
        5.0,
        "m",
        "neighbouring points farther apart are not connected, unless as on a wall seen at a grazing angle. More: "
        "walls go on across wider gaps",
        default=0.3,
    )
    min_points: int = whole(
        2, 1000, "a segment needs at least this many points. More: fewer short or far walls", default=6
    )
    min_length: float = number(
        0.0, 10.0, "m", "a segment must be at least this long. More: short walls are rejected", default=0.2
    )
    corner_angle: float = number(
        0.02,
        1.57,
        "rad",
        "two walls make a corner if the angle between them is at least this. More: fewer flat corners",
        default=0.35,
    )
    corner_gap: float = number(
        0.01,
        2.0,
        "m",
        "both facing ends must be this close to the intersection, beyond point spacing and noise. More: corners "
        "also where walls do not quite meet",
        default=0.2,
    )

    @field_validator("fitter")
    @classmethod
    def _known_fitter(cls, name: str) -> str:
        if name not in FITTERS:
            raise ValueError(f"unknown fitter {name!r}: choose one of {', '.join(FITTERS)}")
        return name
