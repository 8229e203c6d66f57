"""Captures: the bytes on the serial line as they came, for replay and for finding out what a sensor really sent.

A capture is one line of JSON, {"rplidar_capture": 1, "answer_type": .., "us_per_sample": .., "baud": ..}, then records,
all little-endian: direction (1 byte, "<" from the sensor, ">" to it), Unix time in s (float64), number of bytes
(uint32), the bytes. Every record is written at once: after `kill -9` at most the last one is incomplete.
"""

import json
import struct
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import IO, Any, Literal

from lidarcore.closing import Closing
from lidarcore.errors import RecordingError
from lidarcore.files.growing_file import GrowingFile
from lidarcore.files.streams import MAX_LINE, take

Direction = Literal["in", "out"]
Piece = tuple[Direction, float, bytes]
"""direction, Unix time in s, bytes"""

SIGNATURE = b'{"rplidar_capture": 1'
_MARKS: dict[Direction, bytes] = {"in": b"<", "out": b">"}
_DIRECTIONS: dict[bytes, Direction] = {mark: direction for direction, mark in _MARKS.items()}
_RECORD = struct.Struct("<cdI")


@dataclass(frozen=True)
class Stream:
    """What one has to know of a stream of measurements whose start is not in the capture; None if unknown.

    answer_type    of the descriptor that announced it, e.g. 0x85
    us_per_sample  time between two samples in us
    baud           of the line
    """

    answer_type: int | None = None
    us_per_sample: float | None = None
    baud: int = 256000


class CaptureWriter(Closing):
    """Writes a capture; its `write` is made to be the tap of a Driver.

    stream  what is streaming already when the capture begins
    Raises RecordingError, here and in `write`, if the file exists already or cannot be written; see GrowingFile.
    """

    def __init__(self, path: str | PathLike[str], stream: Stream | None = None) -> None:
        self._file = GrowingFile(Path(path))
        about = {"rplidar_capture": 1, **asdict(stream or Stream())}
        self._file.write(json.dumps(about).encode() + b"\n")

    @property
    def size(self) -> int:
        """Bytes that are in the file."""
        return self._file.size

    def write(self, direction: Direction, time: float, data: bytes) -> None:
        """Add bytes that were read ("in") or written ("out") at a Unix time in s."""
        self._file.write(_RECORD.pack(_MARKS[direction], time, len(data)) + data)
        self._file.flush()

    def close(self) -> None:
        """Close the file; one without a record is removed."""
        self._file.close()


def read_stream(file: IO[bytes]) -> Stream:
    """Read the first line of a capture. Raises RecordingError if it is none."""
    line = file.readline(MAX_LINE)
    try:
        about: dict[str, Any] = json.loads(line)
        if about.pop("rplidar_capture") == 1:
            return Stream(**about)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise RecordingError(f"This is not a capture of version 1: it begins with {line[:40]!r}.") from error
    raise RecordingError(f"This capture is of another version than 1: it begins with {line[:40]!r}.")


def read_pieces(file: IO[bytes], remark: Callable[[str], None] = lambda _: None) -> Iterator[Piece]:
    """Yield the records that follow the first line, up to the first that is incomplete or damaged.

    If there is such a one, `remark` is told.
    """
    while head := file.read(_RECORD.size):
        try:
            mark, time, size = _RECORD.unpack(head)
            piece = _DIRECTIONS[mark], time, take(file, size)
        except (KeyError, EOFError, ValueError, struct.error):
            remark("The capture is damaged or cut short: everything before is read.")
            return
        yield piece
