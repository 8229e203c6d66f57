"""Serial bytes of an RPLIDAR as text, as terminal programs and small scripts log them."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import chain

from lidarcore.recordings.base import Recording
from lidarcore.recordings.pace import NOMINAL_PERIOD
from lidarcore.rplidar.listener import BEGINNING, Listener
from lidarcore.rplidar.protocol import Answer, Descriptor, Revolution
from lidarcore.scan import Scan

BYTE = re.compile(rb"\b(?:0[xX])?([0-9a-fA-F]{2})\b")
HALF_A_BYTE = re.compile(rb"(?:\s|\A)(?:0[xX]?|(?:0[xX])?[0-9a-fA-F])\Z")
COMMENT = re.compile(rb"->[^\n]*")
PIECE = 1 << 16  # bytes that are taken apart at a time


class RplidarHex(Recording):
    """Hexadecimal bytes, with 0x or beginning with a request or answer (A5); `->` begins a comment.

    What came from the sensor and what went to it cannot be told apart, and there are no times.
    """

    name, sensor = "RPLIDAR hex dump", "RPLIDAR"
    signature = re.compile(rb"\A\s*(?:(?:0[xX][0-9a-fA-F]{2}[\s,]+){16}|[aA]5[ \t]+[0-9a-fA-F]{2}\s)")

    def _open(self, topic: str | None) -> None:
        self._choose((), topic)
        self._remark(f"There are no stamps: revolutions are taken to be {NOMINAL_PERIOD} s apart.")

    def _scans(self) -> Iterator[Callable[[], Scan]]:
        listener = Listener(None if self._begins() else Answer.NODES)
        revolutions = chain.from_iterable(listener.received(data, 0.0) for data in self._bytes())
        for index, revolution in enumerate(revolutions):
            yield partial(_scan, revolution, NOMINAL_PERIOD * index)
        for reason, count in listener.close().items():
            self._count(f"{reason.replace('_', ' ')} left out", count)

    def _bytes(self) -> Iterator[bytes]:
        """Yield what was dumped, piece by piece: as words the file would take fifteen times its size."""
        rest = b""
        with self._stream() as stream:
            while piece := stream.read(PIECE):
                text = rest + piece
                cut = text.rfind(b"\n") + 1 or max(map(text.rfind, (b" ", b"\t", b","))) + 1
                yield _parsed(text[:cut])
                rest = text[cut:]
        if HALF_A_BYTE.search(rest):
            self._remark("The dump is damaged or cut short: its last byte is incomplete.")
        yield _parsed(rest)

    def _begins(self) -> bool:
        """Whether there is a descriptor of a scan."""
        before = b""
        for data in self._bytes():
            if BEGINNING.search(before + data):
                return True
            before = data[-Descriptor.SIZE :]
        return False


def _parsed(text: bytes) -> bytes:
    return bytes.fromhex(b"".join(BYTE.findall(COMMENT.sub(b"", text))).decode())


def _scan(revolution: Revolution, stamp: float) -> Scan:
    return replace(revolution.scan(), stamp=stamp, beam_times=None)
