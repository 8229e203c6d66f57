"""What someone has chosen to look at."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Selection:
    """Ids of a corner of the frame and of a landmark of the map, or None."""

    corner: int | None = None
    landmark: int | None = None
