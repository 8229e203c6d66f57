"""What extraction rejected in one scan, and why, in words."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, overload

import numpy as np

from lidarcore import tables
from lidarcore.arrays import Array
from lidarcore.lines import STATUS_MESSAGES
from lidarcore.table_view import TableView


@dataclass(frozen=True, slots=True, eq=False)
class Rejection:
    """A piece that is no segment, or a pair of neighbours that makes no corner, and why."""

    kind: Literal["segment", "corner"]
    reason: str
    message: str
    first_beam: int
    last_beam: int
    xy: Array
    value: float
    limit: float


class Rejections(TableView, Sequence[Rejection]):
    """All rejections of one scan, made readable when asked for."""

    @overload
    def __getitem__(self, i: int) -> Rejection: ...
    @overload
    def __getitem__(self, i: slice) -> list[Rejection]: ...
    def __getitem__(self, i: int | slice) -> Rejection | list[Rejection]:
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(len(self)))]
        row = self._table[i]
        value, limit, why = float(row[tables.VALUE]), float(row[tables.LIMIT]), int(row[tables.REASON])
        kind, reason, text = _REASONS[why]
        found = STATUS_MESSAGES.get(int(value), "") if why == tables.DEGENERATE else ""
        message = text.format(
            value=value, limit=limit, found=found, angle=_degrees(value), least=_degrees(limit)
        )
        first_beam, last_beam = row[tables.REJECTED_BEAMS : tables.REJECTED_BEAMS + 2].astype(int).tolist()
        xy = row[tables.REJECTED_XY : tables.REJECTED_XY + 2]
        return Rejection(kind, reason, message, first_beam, last_beam, xy, value, limit)


def _degrees(sine: float) -> float:
    return float(np.degrees(np.arcsin(min(sine, 1.0))))


_REASONS: dict[int, tuple[Literal["segment", "corner"], str, str]] = {
    tables.TOO_FEW_POINTS: (
        "segment",
        "too few points",
        "Too few points in a line: {value:.0f}, and min_points is {limit:.0f}.",
    ),
    tables.TOO_SHORT: ("segment", "too short", "Too short: {value:.2f} m, and min_length is {limit:.2f} m."),
    tables.DEGENERATE: ("segment", "no line", "The fitter gave no line: {found}."),
    tables.TOO_FLAT: (
        "corner",
        "angle too small",
        "The walls are too parallel: {angle:.0f}° apart, and corner_angle is {least:.0f}°.",
    ),
    tables.TOO_FAR: (
        "corner",
        "ends too far",
        "The walls' lines meet {value:.2f} m beyond the end of one of them (occlusion or opening); "
        "corner_gap allows {limit:.2f} m.",
    ),
}
