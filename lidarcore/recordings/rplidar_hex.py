"""Serial bytes of an RPLIDAR as text, as terminal programs and small scripts log them."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

from lidarcore.recordings.base import NOMINAL_PERIOD, Recording
from lidarcore.rplidar.listener import BEGINNING, Listener
from lidarcore.rplidar.protocol import Answer, Revolution
from lidarcore.scan import Scan

BYTE = re.compile(rb"\b(?:0[xX])?([0-9a-fA-F]{2})\b")
HALF_A_BYTE = re.compile(rb"\s(?:0[xX]?|(?:0[xX])?[0-9a-fA-F])\Z")
COMMENT = re.compile(rb"->[^\n]*")


class RplidarHex(Recording):
    """Hexadecimal bytes, with 0x or beginning with a request or answer (A5); `->` begins a comment.

    What came from the sensor and what went to it cannot be told apart, and there are no times.
    """

    name = "RPLIDAR hex dump"
    signature = re.compile(rb"\A\s*(?:(?:0[xX][0-9a-fA-F]{2}[\s,]+){16}|[aA]5[ \t]+[0-9a-fA-F]{2}\s)")

    def _open(self, topic: str | None) -> None:
        self._choose((), topic)
        self._remark(f"There are no stamps: revolutions are taken to be {NOMINAL_PERIOD} s apart.")

    def _scans(self) -> Iterator[Callable[[], Scan]]:
        content = self._content()
        if HALF_A_BYTE.search(content):
            self._remark("The dump is damaged or cut short: its last byte is incomplete.")
        data = bytes.fromhex(b"".join(BYTE.findall(COMMENT.sub(b"", content))).decode())
        listener = Listener(None if BEGINNING.search(data) else Answer.NODES)
        for index, revolution in enumerate(listener.received(data, 0.0)):
            yield partial(_scan, revolution, NOMINAL_PERIOD * index)
        for reason, count in listener.close().items():
            self._count(f"{reason.replace('_', ' ')} left out", count)


def _scan(revolution: Revolution, stamp: float) -> Scan:
    return replace(revolution.scan(), stamp=stamp, beam_times=None)
