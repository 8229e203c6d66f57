"""Text that SLAMTEC's tools write: frame_grabber's saved scans and ultra_simple's print-out."""

import re
from collections.abc import Iterator

import numpy as np

from lidarcore.files.streams import lines
from lidarcore.recordings.base import MOST_BEAMS
from lidarcore.recordings.rplidar.revolutions import Revolution, RplidarRecording

NUMBER = rb"([-+]?\d+(?:\.\d*)?)"
PRINTED = re.compile(rb"theta: *%b +Dist: *%b +Q: *%b" % (NUMBER, NUMBER, NUMBER))
SAVED = re.compile(rb"^\s*%b\s+%b\s+%b\s*$" % (NUMBER, NUMBER, NUMBER))
ANNOUNCED = re.compile(rb"^#COUNT=(\d{1,9})")

STEP_BACK = 30.0
"""deg: the tools sort each revolution by angle, so the next one begins where the angle falls back.

The S of ultra_simple marks the sample that opened the revolution, which once sorted may be the last."""


class SlamtecDump(RplidarRecording):
    """A text of one or several revolutions: "angle distance quality", or "theta: .. Dist: .. Q: ..".

    Lines that are neither, like the device's serial number, are skipped.
    """

    name = "SLAMTEC text dump"
    signature = re.compile(rb"\A\s*#RPLIDAR SCAN DATA|%b" % PRINTED.pattern)

    def _revolutions(self) -> Iterator[Revolution]:
        samples: list[tuple[float, ...]] = []
        for sample in self._samples():
            if samples and (sample[0] < samples[-1][0] - STEP_BACK or len(samples) > MOST_BEAMS):
                yield Revolution(np.array(samples))
                samples = []
            samples.append(sample)
        if samples:
            yield Revolution(np.array(samples))

    def _samples(self) -> Iterator[tuple[float, ...]]:
        announced = found = 0
        with self._stream() as stream:
            for line in lines(stream, self._remark):
                if sample := PRINTED.search(line) or SAVED.match(line):
                    found += 1
                    yield tuple(map(float, sample.groups()))
                elif header := ANNOUNCED.match(line):
                    announced += int(header[1])
        if announced and announced != found:
            self._remark(f"The headers announce {announced} samples, {found} are there.")
