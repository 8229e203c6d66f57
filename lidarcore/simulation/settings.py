"""What a user can set about a simulation: declared once, with unit, range and meaning."""

from dataclasses import field
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from lidarcore.arrays import Array
from lidarcore.fields import number, settings, whole
from lidarcore.localization.motion_noise import OdometryNoise
from lidarcore.noise import SensorNoise
from lidarcore.simulation.worlds import WORLDS, place


@settings
class OdometryError:
    """How odometry errs: a random walk as filters assume, and systematic errors of wheels as they do not."""

    noise: OdometryNoise = field(default_factory=OdometryNoise)
    scale: float = number(
        -0.5,
        0.5,
        "",
        "share by which every way is measured too long. More: odometry drifts faster along the way",
        default=0.0,
    )
    track: float = number(
        -0.5,
        0.5,
        "",
        "share by which every turn is measured too large. More: odometry's heading drifts faster",
        default=0.0,
    )

    def measured(self, increment: Array, rng: np.random.Generator) -> Array:
        """What wheels say of a true increment (3,) m, m, rad, seen from where it starts."""
        systematic = increment * [1 + self.scale, 1 + self.scale, 1 + self.track]
        sigma = np.sqrt(np.diag(self.noise.covariance(increment)))
        return systematic + rng.normal(0, 1, 3) * sigma


@settings
class SimulationSettings:
    """Where a simulated robot drives and what it perceives. Immutable; pydantic.ValidationError names a wrong field."""

    world: Annotated[
        str, Field(description="where the robot is", json_schema_extra={"enum": list(WORLDS)})
    ] = "two rooms"
    path: Annotated[
        str | None, Field(description="how it moves, one of the world's paths; none for the usual one")
    ] = None
    odometry: OdometryError = field(default_factory=OdometryError)
    field_of_view: float = number(
        0.1,
        2 * np.pi,
        "rad",
        "angle that the sensor sees, half to either side of ahead. More: more of the room in every scan",
        default=2 * np.pi,
    )
    max_range: float = number(
        0.5, 100.0, "m", "nothing farther is seen. More: farther walls are seen", default=40.0
    )
    noise: SensorNoise = field(default_factory=lambda: SensorNoise(0.01, 0.001))
    mixed: float = number(
        0,
        1,
        "",
        "share of the beams at an edge that report a range in between. More: more stray points at edges",
        default=0.5,
    )
    dropouts: float = number(
        0, 1, "", "share of the beams that are lost for no reason. More: more holes in walls", default=0.003
    )
    people: int = whole(0, 20, "how many walk about. More: more that moves and hides walls", default=0)
    seed: int = whole(0, 2**31 - 1, "of everything that is random", default=0)

    @model_validator(mode="after")
    def _known_place(self) -> "SimulationSettings":
        place(self.world).path(self.path)
        return self
