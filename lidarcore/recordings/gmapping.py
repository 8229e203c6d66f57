"""GMapping's .gfs: LASER_READING lines among those of its particles.

Format: as gridslamprocessor.cpp of GMapping writes it.
"""

import re

from lidarcore.recordings.laser_log import LaserLog, Reading, numbers
from lidarcore.recordings.laser_survey import SICK_RANGE


class GmappingStream(LaserLog):
    """A .gfs stream. Its poses are raw odometry of the sensor; corrected ones (SM_UPDATE) are not read."""

    name = "GMapping .gfs"
    signature = re.compile(rb"^(LASER_READING \d+|ODO_UPDATE \d+|ODOM( [-+.\de]+){4}\r?$)", re.MULTILINE)

    def _parse(self, words: list[bytes]) -> Reading | None:
        if not words or words[0] != b"LASER_READING":
            return None
        number = int(words[1])
        ranges, last = numbers(words[2:], number), numbers(words[2 + number :], 4)
        return Reading("LASER_READING", ranges, None, SICK_RANGE, stamps=(float(last[3]),), pose=last[:3])
