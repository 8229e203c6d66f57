"""A scan on its way from the source to a frame."""

from dataclasses import dataclass

from app.wire import PositionJson
from lidarcore import Scan


@dataclass(frozen=True, slots=True)
class Taken:
    """A scan as the source of a name handed it over, and when its last byte had arrived (time.monotonic, s)."""

    scan: Scan
    name: str
    position: PositionJson
    source: int  # changes with every source opened
    seeks: int  # changes whenever someone goes to another scan of it
    arrival: float
