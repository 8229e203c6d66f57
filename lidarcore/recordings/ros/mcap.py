"""MCAP files, read record by record as they were written: needs no index, so a truncated file can be read.

Format: https://mcap.dev/spec
"""

import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from io import BytesIO
from typing import IO

from lidarcore.files.streams import DAMAGE, Unpacker, available, skip, take
from lidarcore.recordings.ros.messages import WANTED, Message, check_topics, plain_type

MAGIC = b"\x89MCAP0\r\n"
SCHEMA, CHANNEL, MESSAGE, CHUNK, METADATA_RECORD, DATA_END = 3, 4, 5, 6, 12, 15
METADATA = "lidarcore"  # name of what this library keeps beside the messages
MASK, SENSOR = "mask", "sensor"  # its keys
MOST_METADATA = 1 << 14  # bytes of a record; larger ones are of others


class McapReader:
    """Reads the ROS messages of the WANTED types, and each topic's type into `connections`.

    `metadata` gets what this library keeps beside them, the last of each key.
    """

    def __init__(
        self,
        unpacker: Unpacker,
        remark: Callable[[str], None],
        count: Callable[[str, int], None],
        connections: dict[str, str],
    ) -> None:
        self._unpacker, self._remark, self._count, self._connections = unpacker, remark, count, connections
        self.metadata: dict[str, str] = {}
        self._types: dict[int, str] = {}
        self._channels: dict[int, tuple[str, str, str]] = {}

    def messages(self, stream: IO[bytes]) -> Iterator[Message]:
        """Yield the messages up to the first damage."""
        try:
            take(stream, len(MAGIC))
            for opcode, data in _walk(stream):
                if opcode == CHUNK:
                    yield from self._chunk(data)
                elif message := self._record(opcode, data):
                    yield message
        except DAMAGE:
            self._remark("The MCAP file is damaged or cut short: everything before is read.")

    def _chunk(self, data: bytes) -> Iterator[Message]:
        try:
            for opcode, record in _walk(BytesIO(self._unpacked(data))):
                if message := self._record(opcode, record):
                    yield message
        except DAMAGE:
            self._count("damaged chunks, whose rest is left out", 1)

    def _unpacked(self, chunk: bytes) -> bytes:
        """Records of a chunk, or what there is of them. Raises ValueError if their checksum is wrong."""
        stream = BytesIO(chunk)
        _, _, full_size, checksum = _read(stream, "<QQQI")
        compression, (size,) = _string(stream), _read(stream, "<Q")
        records = self._unpacker.unpack(compression, available(stream, size))
        if checksum and len(records) == full_size and zlib.crc32(records) != checksum:
            raise ValueError("its checksum is wrong")
        return records

    def _record(self, opcode: int, data: bytes) -> Message | None:
        """Take up a schema or channel, or return a wanted message."""
        stream = BytesIO(data)
        if opcode == SCHEMA:
            (schema,) = _read(stream, "<H")
            self._types[schema] = plain_type(_string(stream))
        elif opcode == CHANNEL:
            channel, schema = _read(stream, "<HH")
            topic, encoding = _string(stream), _string(stream)
            self._channels[channel] = topic, self._types.get(schema, "unknown type"), encoding
            self._connections[topic] = self._channels[channel][1]
            check_topics(len(self._connections))
        elif opcode == METADATA_RECORD:
            with suppress(*DAMAGE):  # the messages are read all the same
                if _string(stream) == METADATA:
                    self.metadata |= _texts(BytesIO(take(stream, *_read(stream, "<I"))))
        elif opcode == MESSAGE:
            channel, _, log_time, _ = _read(stream, "<HIQQ")
            topic, type_, encoding = self._channels[channel]
            if type_ in WANTED and encoding in ("cdr", "ros1"):
                return Message(topic, type_, encoding, log_time * 1e-9, stream.read())
        return None


def _walk(stream: IO[bytes]) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each record that is read; the last may be cut short."""
    while opcode := stream.read(1):
        (size,) = _read(stream, "<Q")
        if opcode[0] == DATA_END:
            return
        wanted = opcode[0] in (SCHEMA, CHANNEL, MESSAGE, CHUNK)
        if not wanted and not (opcode[0] == METADATA_RECORD and size <= MOST_METADATA):
            skip(stream, size)
            continue
        data = available(stream, size)
        if len(data) == size or opcode[0] == CHUNK:
            yield opcode[0], data
        if len(data) < size:
            raise EOFError("the last record is cut short")


def _read(stream: IO[bytes], layout: str) -> tuple[int, ...]:
    return struct.unpack(layout, take(stream, struct.calcsize(layout)))


def _texts(stream: IO[bytes]) -> dict[str, str]:
    """A map of strings."""
    texts = {}
    while size := stream.read(4):
        key = take(stream, *struct.unpack("<I", size)).decode()
        texts[key] = _string(stream)
    return texts


def _string(stream: IO[bytes]) -> str:
    return take(stream, _read(stream, "<I")[0]).decode()
