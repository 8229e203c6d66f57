"""ROS 1 bags, read record by record as they were written: it does not matter if the index is broken.

Format: http://wiki.ros.org/Bags/Format/2.0
"""

import re
import struct
from collections.abc import Iterator
from io import BytesIO
from typing import IO

from lidarcore.errors import RecordingError
from lidarcore.files.streams import DAMAGE, Unpacker, available, skip, take
from lidarcore.recordings.ros.messages import WANTED, Message, check_topics, plain_type
from lidarcore.recordings.ros.recording import RosRecording

Header = dict[bytes, bytes]

MAX_HEADER = 1 << 16
MESSAGE, INDEX, CHUNK, CONNECTION = b"\x02", b"\x04", b"\x05", b"\x07"
_TIME = struct.Struct("<II")


class Rosbag1(RosRecording):
    """A ROS 1 bag, V2.0: chunks plain, bz2 or lz4; also unclosed, unindexed and truncated ones."""

    name = "ROS 1 bag"
    signature = re.compile(rb"\A#ROSBAG V")

    def _messages(self, connections: dict[str, str]) -> Iterator[Message]:
        with self._stream() as stream:
            version = stream.readline(64).strip()
            if version != b"#ROSBAG V2.0":
                raise RecordingError(
                    f"{self.path.name} is a bag of version {version[9:].decode(errors='replace')!r}: "
                    "only 2.0 is known; `rosbag fix` or `rosbag reindex` brings older ones to it."
                )
            known: dict[bytes, tuple[str, str]] = {}
            for header, data in self._records(stream):
                try:
                    if header[b"op"] == CONNECTION:
                        topic, type_ = header[b"topic"].decode(), plain_type(_fields(data)[b"type"].decode())
                        known[header[b"conn"]] = topic, type_
                        connections[topic] = type_
                        check_topics(len(known))
                    elif (connection := known[header[b"conn"]])[1] in WANTED:
                        time = _TIME.unpack(header[b"time"])
                        yield Message(*connection, "ros1", time[0] + time[1] * 1e-9, data)
                except DAMAGE:
                    self._count("damaged records left out", 1)

    def _records(self, stream: IO[bytes]) -> Iterator[tuple[Header, bytes]]:
        """Yield connections and messages, from inside the chunks, up to the first damage."""
        unpacker = Unpacker(self.path)
        try:
            for header, data in _walk(stream):
                if header[b"op"] == CHUNK:
                    yield from self._chunk(header, data, unpacker)
                else:
                    yield header, data
        except DAMAGE:
            self._remark("The bag is damaged or cut short: everything before is read.")

    def _chunk(self, header: Header, data: bytes, unpacker: Unpacker) -> Iterator[tuple[Header, bytes]]:
        try:
            method = header[b"compression"].decode().replace("none", "")
            yield from _walk(BytesIO(unpacker.unpack(method, data)))
        except DAMAGE:
            self._count("damaged chunks, whose rest is left out", 1)


def _walk(stream: IO[bytes]) -> Iterator[tuple[Header, bytes]]:
    """Yield header and data of each connection, message and chunk; the last chunk may be cut short."""
    while length := stream.read(4):
        header = _fields(take(stream, _length(length, MAX_HEADER)))
        size = _length(take(stream, 4))
        if header[b"op"] == INDEX:
            size = 12 * _length(header[b"count"])  # early recorders wrote 20 * count, and 12 * count bytes
        if header[b"op"] not in (MESSAGE, CHUNK, CONNECTION):
            skip(stream, size)
            continue
        data = available(stream, size)
        if len(data) == size or header[b"op"] == CHUNK:
            yield header, data
        if len(data) < size:
            raise EOFError("the last record is cut short")


def _length(field: bytes, limit: int = 1 << 32) -> int:
    length: int = struct.unpack("<I", field)[0]
    if length > limit:
        raise ValueError(f"a length of {length} bytes")
    return length


def _fields(data: bytes) -> Header:
    """Take apart the name=value fields of a header."""
    fields: Header = {}
    stream = BytesIO(data)
    while length := stream.read(4):
        name, _, value = take(stream, _length(length)).partition(b"=")
        fields[name] = value
    return fields
