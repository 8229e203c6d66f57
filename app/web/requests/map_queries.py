"""What requests ask of a map: a part of the plane, which landmarks, and how many at a time."""

import math
from typing import Annotated

from fastapi import Depends, Query
from pydantic import Field

from lidarcore.landmarks import MAX_COORDINATE, MAX_ID, Box, Circle, Filter

from ..problems import ProblemError
from ..schemas import Finite

MOST, USUAL = 1000, 100  # landmarks, or states, of a page
Metres = Annotated[float, Field(ge=-MAX_COORDINATE, le=MAX_COORDINATE, allow_inf_nan=False)]


async def _region(
    bbox: Annotated[
        str | None, Query(description="min_x,min_y,max_x,max_y in m", examples=["-2.5,-2,4,2.5"])
    ] = None,
    x: Annotated[Metres | None, Query(description="m")] = None,
    y: Annotated[Metres | None, Query(description="m")] = None,
    radius: Annotated[float | None, Query(ge=0, allow_inf_nan=False, description="m about x, y")] = None,
) -> Box | Circle | None:
    """A box or a circle. Raises ProblemError 422 if it is neither."""
    if (x is None) != (y is None) or (y is None) != (radius is None):
        raise ProblemError(422, "A circle has x, y and radius: give all three, or none.")
    if bbox is None:
        return None if x is None or y is None or radius is None else Circle(x, y, radius)
    if radius is not None:
        raise ProblemError(422, "Give bbox, or x, y and radius, not both.")
    try:
        x_min, y_min, x_max, y_max = map(float, bbox.split(","))
    except ValueError as error:
        raise ProblemError(422, f"bbox is {bbox!r}: give min_x,min_y,max_x,max_y in metres.") from error
    if any(map(math.isnan, (x_min, y_min, x_max, y_max))):
        raise ProblemError(
            422, f"bbox is {bbox!r}: nan is no number; give min_x,min_y,max_x,max_y in metres."
        )
    if not (x_min <= x_max and y_min <= y_max):
        raise ProblemError(
            422, f"bbox is {bbox!r}: give min_x,min_y,max_x,max_y, no minimum above its maximum."
        )
    return Box(x_min, y_min, x_max, y_max)


async def _filter(
    kind: Annotated[list[str], Query(description="corner, post, ...; may be repeated")] = [],  # noqa: B006
    method: Annotated[list[str], Query(description="what found it; may be repeated")] = [],  # noqa: B006
    since: Annotated[Finite, Query(description="s: seen then or later")] = -math.inf,
    until: Annotated[Finite, Query(description="s: seen then or before")] = math.inf,
    min_count: Annotated[int, Query(ge=0, le=MAX_ID, description="seen at least so often")] = 1,
    max_sigma: Annotated[
        Finite, Query(ge=0, description="m, along the longest axis of the ellipse")
    ] = math.inf,
) -> Filter:
    """Which landmarks count. Raises ProblemError 422 if since is after until."""
    if since > until:
        raise ProblemError(422, f"since ({since:.15g} s) is after until ({until:.15g} s): swap them.")
    return Filter(
        kinds=tuple(kind),
        methods=tuple(method),
        seen_from=since,
        seen_to=until,
        min_count=min_count,
        max_sigma=max_sigma,
    )


Region = Annotated[Box | Circle | None, Depends(_region)]
Which = Annotated[Filter, Depends(_filter)]
Limit = Annotated[int, Query(ge=1, le=MOST, description="at most so many")]
