"""Raw captures of an RPLIDAR's serial line, see lidarcore/rplidar/capture.py."""

import re
from collections.abc import Callable, Iterator
from functools import partial

from lidarcore.recordings.base import Recording
from lidarcore.rplidar.capture import SIGNATURE, read_pieces, read_stream
from lidarcore.rplidar.listener import Listener
from lidarcore.scan import Scan


class RplidarCapture(Recording):
    """A capture as the driver or the recorder wrote it, decoded as if it came now."""

    name, sensor = "RPLIDAR capture", "RPLIDAR"
    signature = re.compile(rb"\A" + re.escape(SIGNATURE))

    def _open(self, topic: str | None) -> None:
        self._choose((), topic)
        with self._stream() as file:
            self._began = read_stream(file)

    def _scans(self) -> Iterator[Callable[[], Scan]]:
        listener = Listener(self._began.answer_type, self._began.us_per_sample, self._began.baud)
        begin = now = None
        with self._stream() as file:
            read_stream(file)
            for direction, time, data in read_pieces(file, self._remark):
                begin = time if begin is None else begin
                now = max(now or 0.0, time - begin)  # a clock that was set back stands still
                if direction == "out":
                    listener.sent(data)
                    continue
                for revolution in listener.received(data, now):
                    yield partial(revolution.scan, begin)
        for reason, count in listener.close().items():
            self._count(f"{reason.replace('_', ' ')} left out", count)
