"""The noise and mask of every sensor that was set up here, by model and serial number, in one file."""

import logging
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator, TypeAdapter, ValidationError

from lidarcore import files

from ..pipeline.sensor_setups import SensorSetup

MOST = 200  # sensors; those set longest ago are forgotten
MAX_BYTES = 1 << 20

logger = logging.getLogger(__name__)


def _with_mask(entry: object) -> object:
    """Older files have nothing but the noise."""
    return {"noise": entry} if isinstance(entry, Mapping) and "sigma_range" in entry else entry


_Table = TypeAdapter(dict[str, Annotated[SensorSetup, BeforeValidator(_with_mask)]])


@dataclass(frozen=True)
class SensorMemory:
    """A file that is made when the first setup is told. One that is damaged or cannot be written is as good as none."""

    file: Path
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False, repr=False, compare=False)

    def recall(self, sensor: str) -> SensorSetup | None:
        """What was set for that sensor last."""
        with self._lock:
            return self._read().get(sensor)

    def remember(self, sensor: str, setup: SensorSetup) -> None:
        """Keep it, also when the server ends."""
        with self._lock:
            table = self._read()
            table.pop(sensor, None)
            table[sensor] = setup
            newest = dict(list(table.items())[-MOST:])
            try:
                self.file.parent.mkdir(parents=True, exist_ok=True)
                files.write(self.file, _Table.dump_json(newest, indent=1).decode() + "\n")
            except OSError as error:
                logger.warning(
                    "the setup of %s could not be kept in %s: %s", sensor, self.file, error.strerror
                )

    def _read(self) -> dict[str, SensorSetup]:
        try:
            with self.file.open("rb") as file:
                return _Table.validate_json(file.read(MAX_BYTES))
        except FileNotFoundError:
            return {}
        except (OSError, ValidationError) as error:
            logger.warning("%s cannot be read: %s", self.file, error)
            return {}
