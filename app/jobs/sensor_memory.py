"""The noise of every sensor that was set up here, by model and serial number, in one file."""

import logging
import threading
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from lidarcore import SensorNoise, files

MOST = 200  # sensors; those set longest ago are forgotten
MAX_BYTES = 1 << 18

logger = logging.getLogger(__name__)
_Table = TypeAdapter(dict[str, SensorNoise])


@dataclass(frozen=True)
class SensorMemory:
    """A file that is made when the first noise is set. One that is damaged or cannot be written is as good as none."""

    file: Path
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False, repr=False, compare=False)

    def recall(self, sensor: str) -> SensorNoise | None:
        """What was set for that sensor last."""
        with self._lock:
            return self._read().get(sensor)

    def remember(self, sensor: str, noise: SensorNoise) -> None:
        """Keep it, also when the server ends."""
        with self._lock:
            table = self._read()
            table.pop(sensor, None)
            table[sensor] = noise
            newest = dict(list(table.items())[-MOST:])
            try:
                self.file.parent.mkdir(parents=True, exist_ok=True)
                files.write(self.file, _Table.dump_json(newest, indent=1).decode() + "\n")
            except OSError as error:
                logger.warning(
                    "the noise of %s could not be kept in %s: %s", sensor, self.file, error.strerror
                )

    def _read(self) -> dict[str, SensorNoise]:
        try:
            with self.file.open("rb") as file:
                return _Table.validate_json(file.read(MAX_BYTES))
        except FileNotFoundError:
            return {}
        except (OSError, ValidationError) as error:
            logger.warning("%s cannot be read: %s", self.file, error)
            return {}
