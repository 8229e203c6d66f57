"""CSV tables with one scan in each row: some columns, then the ranges r0, r1, ... of a SICK."""

import re

import numpy as np

from lidarcore.recordings.laser_log import SICK_RANGE, LaserLog, Reading, numbers


class ScanTable(LaserLog):
    """CSV with a header ...,r0,r1,... in m; t, odom_x, odom_y, odom_theta, max_range are used if there."""

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
        pose = np.array([named.get(name, np.nan) for name in (b"odom_x", b"odom_y", b"odom_theta")])
        return Reading(
            "ranges",
            ranges,
            None,
            float(named.get(b"max_range", SICK_RANGE)),
            (float(named.get(b"t", 0.0)),),
            pose=pose if np.isfinite(pose).all() else None,
        )
