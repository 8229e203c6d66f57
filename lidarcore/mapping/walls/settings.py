"""What can be set about the walls of a map."""

from lidarcore.fields import number, settings, whole


@settings
class WallSettings:
    """How the segments of many scans become walls."""

    distance: float = number(
        0.005,
        1.0,
        "m",
        "a segment belongs to a wall if both its ends are this close to the wall's line",
        default=0.06,
    )
    gap: float = number(0.02, 5.0, "m", "a wall ends where it was not seen over more than this", default=0.35)
    free_gap: float = number(
        0.02, 5.0, "m", "a wall ends where the grid is free over more than this", default=0.2
    )
    corner_gap: float = number(
        0.01, 2.0, "m", "walls meet in a corner if their lines meet this close to their ends", default=0.25
    )
    corner_angle: float = number(
        0.05, 1.57, "rad", "least angle between walls that make a corner", default=0.35
    )
    min_length: float = number(0.0, 10.0, "m", "shorter walls are left out", default=0.2)
    min_count: int = whole(1, 1000, "a wall is seen from at least so many keyframes", default=1)
