"""What a user can set about localization: declared once, with unit, range and meaning."""

from dataclasses import field
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from lidarcore.fields import number, settings
from lidarcore.localization.motion_noise import OdometryNoise, VelocityNoise


@settings
class LocalizationSettings:
    """How the filter moves, matches and keeps landmarks. Immutable; pydantic.ValidationError names a wrong field."""

    motion: Annotated[
        Literal["odometry", "constant velocity"], Field(description="what predicts the pose between scans")
    ] = "odometry"
    odometry: OdometryNoise = field(default_factory=OdometryNoise)
    velocity: VelocityNoise = field(default_factory=VelocityNoise)
    max_speed: float = number(
        0.01, 100, "m/s", "odometry that is faster has jumped. More: wilder odometry is believed", default=3.0
    )
    max_turn_rate: float = number(
        0.01,
        100,
        "rad/s",
        "odometry that turns faster has jumped. More: wilder turns are believed",
        default=6.0,
    )
    gate: float = number(
        0.5,
        0.9999,
        "",
        "share of the true pairs that the chi-square gate lets through. "
        "More: fewer true pairs are lost, more wrong ones are taken",
        default=0.99,
    )
    new_gate: float = number(
        0.9,
        0.999999999,
        "",
        "a new landmark lies outside this gate of every known one. "
        "More: fewer landmarks are mapped twice, and fewer of those that are close together at all",
        default=0.99999,
    )
    ambiguity: float = number(
        1,
        1e3,
        "",
        "a pair is ambiguous if it is not this many times likelier than another, or in a known map than chance. "
        "More: fewer wrong pairs, more that are left out",
        default=10.0,
    )
    confirm: Annotated[
        int,
        Field(
            ge=1,
            le=1000,
            description="sightings that confirm a landmark. More: fewer false landmarks, true ones later",
        ),
    ] = 4
    settle: float = number(
        0,
        600,
        "s",
        "time from its first sighting before a landmark is confirmed. "
        "More: fewer of what walks by, true ones later",
        default=1.0,
    )
    memory: Annotated[
        int,
        Field(
            ge=1,
            le=10000,
            description="sightings that count against views without it. "
            "More: landmarks that are gone stay longer",
        ),
    ] = 10

    unevenness: float = number(
        0,
        0.5,
        "m",
        "standard deviation of where a landmark seems to be from one place or another, beside noise. "
        "More: a vaguer map that is less easily wrong",
        default=0.01,
    )

    @model_validator(mode="after")
    def _ordered(self) -> "LocalizationSettings":
        if self.new_gate <= self.gate:
            raise ValueError(f"new_gate {self.new_gate} is not above gate {self.gate}: raise it")
        # Otherwise leaving a pair unmatched could count as the alternative that makes it ambiguous.
        if np.log(self.ambiguity) >= np.log((1 - self.gate) / (1 - self.new_gate)):
            raise ValueError("ambiguity is too large for these gates: lower it, or raise new_gate")
        return self


@settings
class NavigationSettings:
    """What a Navigator does with each scan. Immutable; pydantic.ValidationError names a wrong field."""

    mode: Annotated[
        Literal["off", "localize", "slam"],
        Field(description="localize in a map that is given, or build it at the same time"),
    ] = "off"
    landmarks: Annotated[
        Literal["corners", "clusters"], Field(description="what in a scan serves as landmarks")
    ] = "corners"
    motion: Annotated[
        Literal["auto", "odometry", "constant velocity"],
        Field(description="what predicts the pose between scans; auto: odometry when the source has it"),
    ] = "auto"
    max_width: float = number(
        0.01,
        10,
        "m",
        "wider clusters are not landmarks: the mean of a wall depends on how much of it is in view. "
        "More: larger things are landmarks, too",
        default=0.5,
    )
    filter: LocalizationSettings = field(default_factory=LocalizationSettings)
