"""CSV tables with one scan in each row: some columns, then the ranges r0, r1, ... of a SICK."""

import re

import numpy as np

from lidarcore.recordings.laser_log import LaserLog, Reading, numbers
from lidarcore.recordings.laser_survey import SICK_RANGE


class ScanTable(LaserLog):
    """CSV with a header ...,r0,r1,... in m; t, max_range, odom_ and corr_ with x, y, theta are used if there."""

    name = "CSV table of scans"
    signature = re.compile(rb"\A(\w+,)+r0,r1,[r\d,]+\r?\n")

    def _open(self, topic: str | None) -> None:
        self._columns: list[bytes] = []
        super()._open(topic)

    def _parse(self, words: list[bytes]) -> Reading | None:
        cells = words[0].split(b",")
        if b"r0" in cells:
            self._columns = cells
            return None
        values = numbers(cells, len(self._columns))
        named = dict(zip(self._columns, values, strict=True))
        ranges = values[self._columns.index(b"r0") :]
        odometry, corrected = (
            np.array([named.get(kind + name, np.nan) for name in (b"_x", b"_y", b"_theta")])
            for kind in (b"odom", b"corr")
        )
        return Reading(
            "ranges",
            ranges,
            None,
            float(named.get(b"max_range", SICK_RANGE)),
            (float(named.get(b"t", 0.0)),),
            pose=odometry if np.isfinite(odometry).all() else None,
            truth=corrected if np.isfinite(corrected).all() else None,
        )
