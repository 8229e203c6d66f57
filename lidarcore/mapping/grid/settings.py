"""What can be set about occupancy grids."""

from lidarcore.fields import number, settings, whole


@settings
class GridSettings:
    """How rays become cells. Evidence is kept in log-odds between two bounds, so that a map can change its mind.

    With the defaults a cell takes nine scans that look through it to become free after it was occupied for good.
    """

    resolution: float = number(0.005, 5.0, "m", "side of a cell", default=0.05)
    hit: float = number(0.05, 5.0, "", "log-odds that a return adds to its cell", default=0.85)
    miss: float = number(0.05, 5.0, "", "log-odds that a ray takes from a cell it goes through", default=0.4)
    miss_beside_hit: float = number(
        0.05,
        5.0,
        "",
        "the same of a cell beside one that the scan hits: the pose may be a cell off",
        default=0.1,
    )
    most: float = number(0.1, 6.0, "", "bound of the log-odds of an occupied cell", default=3.5)
    least: float = number(0.1, 6.0, "", "bound of the log-odds of a free cell, below zero", default=2.0)
    max_range: float = number(0.5, 1000.0, "m", "returns from farther away are left out", default=80.0)
    most_cells: int = whole(1, 1_000_000_000, "a grid that would need more is refused", default=100_000_000)
