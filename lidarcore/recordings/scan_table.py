"""CSV tables with one scan in each row: some columns, then the ranges r0, r1, ... of a SICK."""

import re

import numpy as np

from lidarcore.recordings.laser_log import LaserLog, Reading, numbers
from lidarcore.recordings.laser_survey import SICK_RANGE


class ScanTable(LaserLog):
    """CSV with a header ...,r0,r1,... in m; used if there are t, max_range, odom_ and corr_ with x, y, theta, and

    angle_min with angle_increment, rad. Without these two the ranges are taken for those of a SICK, from the right.
    """

    name = "CSV table of scans"
    implied = frozenset()
    signature = re.compile(rb"\A(\w+,)+r0,r1,[r\d,]+\r?\n")

    def _open(self, topic: str | None) -> None:
        self._columns: list[bytes] = []
        self._decimals = 0  # of the last column, at most
        super()._open(topic)

    def _is_whole(self, line: bytes) -> bool:
        """Whether it has all columns, and as many decimals in the last one as any line before."""
        cells = line.strip().split(b",")
        return len(cells) == len(self._columns) and _decimals(cells) >= max(self._decimals, 1)

    def _parse(self, words: list[bytes]) -> Reading | None:
        cells = words[0].split(b",")
        if b"r0" in cells:
            self._columns = cells
            return None
        values = numbers(cells, len(self._columns))
        self._decimals = max(self._decimals, _decimals(cells))
        named = dict(zip(self._columns, values, strict=True))
        ranges = values[self._columns.index(b"r0") :]
        first, step = (named.get(b"angle_" + name) for name in (b"min", b"increment"))
        bearings = None if first is None or step is None else first + step * np.arange(len(ranges))
        odometry, corrected = (
            np.array([named.get(kind + name, np.nan) for name in (b"_x", b"_y", b"_theta")])
            for kind in (b"odom", b"corr")
        )
        return Reading(
            "ranges",
            ranges,
            bearings,
            float(named.get(b"max_range", SICK_RANGE)),
            (float(named.get(b"t", 0.0)),),
            pose=odometry if np.isfinite(odometry).all() else None,
            truth=corrected if np.isfinite(corrected).all() else None,
        )


def _decimals(cells: list[bytes]) -> int:
    """Digits behind the point of the last number, its exponent included."""
    return len(cells[-1].partition(b".")[2])
