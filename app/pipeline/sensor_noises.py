"""Which noise goes with which sensor: what is set for one is never silently used for another's scans."""

from typing import Protocol

from lidarcore import SensorNoise

from ..sources.source import Source


class NoiseMemory(Protocol):
    """Keeps the noise of sensors that can be known again, by model and serial number."""

    def recall(self, sensor: str) -> SensorNoise | None:
        """What was kept for it."""

    def remember(self, sensor: str, noise: SensorNoise) -> None:
        """Keep it."""


class SensorNoises:
    """What was set for each sensor; else what is remembered of it from before, else what its source usually has.

    Only a device says which one it is. The noise of a recording, or of a simulation, is known until the server ends.
    """

    def __init__(self, memory: NoiseMemory) -> None:
        self._memory = memory
        self._told: dict[str, SensorNoise] = {}

    def tell(self, source: Source, noise: SensorNoise) -> None:
        """This is what the sensor of that source errs by, as someone has set it."""
        self._told[source.sensor] = noise
        if source.kind == "device":
            self._memory.remember(source.sensor, noise)

    def of(self, source: Source) -> SensorNoise:
        """The noise to begin with when that source plays."""
        if source.sensor in self._told:
            return self._told[source.sensor]
        kept = self._memory.recall(source.sensor) if source.kind == "device" else None
        return source.noise if kept is None else kept
