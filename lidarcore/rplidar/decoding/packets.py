"""Whole packets found in a stream of bytes, whatever is before, between or missing in them."""

import re
import zlib
from collections.abc import Callable
from dataclasses import dataclass

from lidarcore.rplidar.answers import Answer
from lidarcore.rplidar.commands import xor
from lidarcore.rplidar.decoding.counts import Counts

Run = tuple[int, bytes]
"""How many bytes were passed over before, and the bytes of one or several packets."""


@dataclass(frozen=True)
class Format:
    """How the packets of an answer type look.

    size     bytes of a packet
    samples  measurements in it
    pattern  its group 1 is what may be packets, where the one before was in its place
    seen     bytes that `pattern` looks at
    search   its group 1 is what may be packets, anywhere
    sought   bytes that `search` looks at
    intact   whether the bytes matched are packets
    """

    size: int
    samples: int
    pattern: re.Pattern[bytes]
    seen: int
    search: re.Pattern[bytes]
    sought: int
    intact: Callable[[bytes], bool]


class PacketFinder:
    """Takes any fragments of a stream, gives whole packets, keeps fewer bytes than `Format.sought`."""

    def __init__(self, layout: Format, counts: Counts) -> None:
        self._format, self._counts = layout, counts
        self._buffer, self._skipped, self._in_step = b"", 0, True  # a stream begins with a packet

    @property
    def waiting(self) -> int:
        """Bytes that have arrived and are in no run yet."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[Run]:
        """Runs of packets that these bytes complete."""
        layout, runs = self._format, list[Run]()
        buffer, at = self._buffer + data, 0
        while len(buffer) - at >= (layout.seen if self._in_step else layout.sought):
            if self._in_step:
                match = layout.pattern.match(buffer, at)
            else:
                match = layout.search.search(buffer, at)
                at = self._skip(at, match.start(1) if match else len(buffer) - layout.sought + 1)
            if match and layout.intact(match[1]):
                runs.append((self._skipped, match[1]))
                self._skipped, self._in_step, at = 0, True, match.end(1)
            elif self._in_step:
                self._in_step = False
                self._counts.drop("damaged_packets")
            elif match:
                at = self._skip(at, at + 1)
        self._buffer = buffer[at:]
        return runs

    def _skip(self, start: int, stop: int) -> int:
        self._skipped += stop - start
        self._counts.drop("garbage_bytes", stop - start)
        return stop


def _capsule(size: int, samples: int) -> Format:
    pattern = re.compile(rb"([\xa0-\xaf][\x50-\x5f](?s:.{%d}))" % (size - 2))
    return Format(size, samples, pattern, size, pattern, size, _xor_is_right)


def _xor_is_right(capsule: bytes) -> bool:
    return xor(capsule[2:]) == capsule[0] & 0xF | (capsule[1] & 0xF) << 4


def _hq(size: int, samples: int) -> Format:
    pattern = re.compile(rb"(\xa5(?s:.{%d}))" % (size - 1))
    return Format(size, samples, pattern, size, pattern, size, _crc_is_right)


def _crc_is_right(packet: bytes) -> bool:
    """CRC-32 of the data padded with zeros to a multiple of four bytes."""
    data = packet[:-4] + bytes(-(len(packet) - 4) % 4)
    return zlib.crc32(data) == int.from_bytes(packet[-4:], "little")


def _nodes(beside: int, anywhere: int) -> Format:
    """A node has no checksum, and one in four random ones passes: believed with so many beside it that pass too."""
    # The lowest bits of a node are S and its complement, and in the second byte a check bit that is set.
    flags = b"".join(re.escape(bytes((byte,))) for byte in range(256) if byte & 3 in (1, 2))
    check = b"".join(re.escape(bytes((byte,))) for byte in range(1, 256, 2))
    node = rb"(?:[%b][%b](?s:.{3}))" % (flags, check)
    before, behind = rb"%b{%d}" % (node, beside), rb"(?=%b{%d})" % (node, beside)
    pattern = re.compile(b"(" + node + b"+)" + behind)
    search = re.compile(before + b"(" + node + b"{%d,})" % (anywhere - 2 * beside) + behind)
    return Format(5, 1, pattern, 5 * (beside + 1), search, 5 * anywhere, lambda run: True)


FORMATS = {
    Answer.NODES: _nodes(beside=4, anywhere=16),
    Answer.EXPRESS: _capsule(84, 32),
    Answer.HQ: _hq(781, 96),
    Answer.ULTRA: _capsule(132, 96),
    Answer.DENSE: _capsule(84, 40),
}
