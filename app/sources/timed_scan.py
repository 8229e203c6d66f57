"""A scan on its way from the source to a frame."""

from dataclasses import dataclass
from typing import Literal

from lidarcore import Scan

SourceKind = Literal["device", "emulator", "simulation", "recording"]


@dataclass(frozen=True, slots=True)
class Position:
    """Which scan of its source it is: index from 0, of how many (None where there is no end), play time s."""

    kind: SourceKind
    index: int
    count: int | None
    time: float


@dataclass(frozen=True, slots=True)
class TimedScan:
    """A scan as the source of a name handed it over, and when its last byte had arrived (time.monotonic, s)."""

    scan: Scan
    name: str
    position: Position
    source: int  # changes with every source opened
    seeks: int  # changes whenever someone goes to another scan of it
    arrival: float

    def is_same(self, other: "TimedScan") -> bool:
        """Whether it is the same scan, handed over again; how many there are may have changed since."""
        return (self.source, self.position.index) == (other.source, other.position.index)
