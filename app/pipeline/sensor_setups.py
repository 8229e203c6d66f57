"""Which noise and mask go with which sensor: what is set for one is never silently used for another's scans."""

from dataclasses import dataclass
from typing import Protocol

from lidarcore import SensorNoise
from lidarcore.body_mask import Mask

from ..sources.source import Source


@dataclass(frozen=True, slots=True)
class SensorSetup:
    """What a sensor errs by, and where it sees the robot that carries it."""

    noise: SensorNoise
    mask: Mask = ()


class SetupMemory(Protocol):
    """Keeps the setup of sensors that can be known again, by model and serial number."""

    def recall(self, sensor: str) -> SensorSetup | None:
        """What was kept for it."""

    def remember(self, sensor: str, setup: SensorSetup) -> None:
        """Keep it."""


class SensorSetups:
    """What was set for each sensor; else what is remembered of it from before, else what its source usually has.

    Only a device says which one it is. The setup of a recording, or of a simulation, is known until the server ends.
    """

    def __init__(self, memory: SetupMemory) -> None:
        self._memory = memory
        self._told: dict[str, SensorSetup] = {}

    def tell(self, source: Source, setup: SensorSetup) -> None:
        """Note the setup that someone has chosen for the sensor of that source."""
        self._told[source.sensor] = setup
        if source.kind == "device":
            self._memory.remember(source.sensor, setup)

    def of(self, source: Source) -> SensorSetup:
        """The setup to begin with when that source plays."""
        if source.sensor in self._told:
            return self._told[source.sensor]
        kept = self._memory.recall(source.sensor) if source.kind == "device" else None
        return SensorSetup(source.noise, source.mask) if kept is None else kept
