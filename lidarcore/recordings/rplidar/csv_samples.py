"""CSV files of RPLIDAR samples, as scripts around the python-rplidar package write them."""

import re
from collections.abc import Iterator
from itertools import groupby, islice

import numpy as np

from lidarcore.files.streams import lines
from lidarcore.recordings.base import MOST_BEAMS
from lidarcore.recordings.rplidar.revolutions import Revolution, RplidarRecording

FLAGGED = b"newscan,angle,distance"
STATIONS = b"station,rev,angle_deg,distance_mm"

Values = tuple[float, ...]


class RplidarCsv(RplidarRecording):
    """CSV with the header newscan,angle,distance[,quality] or station,rev,angle_deg,distance_mm."""

    name = "RPLIDAR CSV"
    signature = re.compile(rb"\A\s*(%b(,quality)?|%b)\s*\n" % (FLAGGED, STATIONS))

    def _revolutions(self) -> Iterator[Revolution]:
        for key, samples in groupby(self._samples(), key=lambda keyed: keyed[0]):
            sweep = [sample for _, sample in islice(samples, MOST_BEAMS + 1)]
            yield Revolution(np.array(sweep), station=key[0] if len(key) > 1 else 0.0)

    def _samples(self) -> Iterator[tuple[Values, Values]]:
        """Yield what tells one revolution from the next, and the sample."""
        with self._stream() as stream:
            rows = (line.strip() for line in lines(stream, self._remark) if line.strip())
            header = next(rows, b"")
            commas, starts = header.count(b","), 0
            for row in rows:
                try:
                    values = tuple(map(float, row.split(b",")))
                except ValueError:
                    values = ()
                if len(values) != commas + 1:
                    self._count("damaged lines left out", 1)
                elif header == STATIONS:
                    yield values[:2], values[2:]
                else:
                    starts += values[0] == 1
                    yield (starts,), values[1:]
