"""One wall of a map, as it is kept."""

from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True)
class StoredWall:
    """A surface seen from one side, in the frame of its map: x cos(alpha) + y sin(alpha) = r, rad and m.

    id                                its own in the map, as the one who mapped gave it
    var_alpha, cov_alpha_r, var_r     covariance of the line: rad², rad m, m²
    x1, y1, x2, y2                    m, its ends; who looks from the first to the second has the free side on the left
    length, var_length                m, m²
    ended_1, ended_2                  0 at an end beyond which the wall may go on, for nobody looked there
    corner_1, corner_2                1 at an end that is a corner
    first_seen, last_seen             s
    count                             number of keyframes that saw it
    """

    id: int
    alpha: float
    r: float
    var_alpha: float
    cov_alpha_r: float
    var_r: float
    x1: float
    y1: float
    x2: float
    y2: float
    length: float
    var_length: float
    ended_1: int
    ended_2: int
    corner_1: int
    corner_2: int
    first_seen: float
    last_seen: float
    count: int


COLUMNS = tuple(field.name for field in fields(StoredWall))
