"""Files as bounded streams: unpacked on the way, never trusting the lengths they claim."""

import bz2
import gzip
import io
import struct
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import IO, Any, Protocol

from lidarcore.errors import RecordingError
from lidarcore.files.reasons import UNPACKING, zstd

HEAD = 1 << 16
"""Bytes a format may look at to recognise itself."""

MEBIBYTE = 1 << 20
MAX_LINE = MEBIBYTE
MAX_RECORD = 32 * MEBIBYTE
MAX_CONTENT = 256 * MEBIBYTE

DAMAGE = (EOFError, KeyError, ValueError, OSError, RuntimeError, struct.error, *UNPACKING)
"""What broken records lead to: cut short, a field missing, a length too long, or not to be unpacked."""

GZIP, ZSTD = b"\x1f\x8b", b"\x28\xb5\x2f\xfd"


def allowance(path: Path) -> int:
    """Bytes that a file may unpack to: recordings are packed 3- to 15-fold, bombs a thousandfold."""
    return 16 * MEBIBYTE + 20 * path.stat().st_size


def whole(path: Path) -> int:
    """Bytes that a file may unpack to if it has to be in memory as a whole."""
    return min(MAX_CONTENT, 32 * MEBIBYTE + 2 * path.stat().st_size)


def _too_large(path: Path) -> RecordingError:
    return RecordingError(
        f"{path.name} unpacks to more than {allowance(path) // MEBIBYTE} MiB, beyond what recordings do: "
        "if you trust it, unpack it yourself and open the result."
    )


class _Packed(Protocol):
    def read1(self, size: int = -1, /) -> bytes: ...
    def close(self) -> None: ...


class _Unpacked(io.RawIOBase):
    """What a packed file holds, up to its `allowance` and to the first damage."""

    def __init__(self, path: Path, packed: _Packed, remark: Callable[[str], None]) -> None:
        self._path, self._packed, self._left, self._remark = path, packed, allowance(path), remark

    def readable(self) -> bool:
        return True

    def close(self) -> None:
        self._packed.close()
        super().close()

    def readinto(self, buffer: bytearray | memoryview) -> int:  # type: ignore[override]
        try:
            piece = self._packed.read1(len(buffer))
        except (EOFError, OSError, *UNPACKING):
            self._remark("The packed file is damaged or cut short: everything before is read.")
            return 0
        self._left -= len(piece)
        if self._left < 0:
            raise _too_large(self._path)
        buffer[: len(piece)] = piece
        return len(piece)


def is_packed(head: bytes) -> bool:
    """Say whether the bytes begin a gzip or zstd file."""
    return head.startswith((GZIP, ZSTD))


def open_stream(path: Path, remark: Callable[[str], None]) -> io.BufferedReader:
    """Open a file for reading, unpacked if it is gzip or zstd; damage of the packing goes to `remark`.

    Raises RecordingError (while reading) if it unpacks to more than its `allowance`.
    """
    with path.open("rb") as file:
        head = file.read(4)
    if not is_packed(head):
        return path.open("rb")
    packed: _Packed = gzip.GzipFile(path) if head.startswith(GZIP) else zstd.ZstdFile(path)
    return io.BufferedReader(_Unpacked(path, packed, remark), MEBIBYTE)


def read_head(path: Path, remark: Callable[[str], None] = lambda _: None) -> bytes:
    """Read the first bytes of the file's content, unpacked; damage of the packing goes to `remark`."""
    with open_stream(path, remark) as stream:
        return stream.read(HEAD)


def available(stream: IO[bytes], size: int, most: int = MAX_RECORD) -> bytes:
    """Read `size` bytes or what there is of them, piece by piece: memory does not grow with what is claimed.

    Raises ValueError if the size is beyond any record.
    """
    if size > most:
        raise ValueError(f"a record claims {size} bytes, more than {most}")
    return bytes(gathered(stream, size))


def gathered(stream: IO[bytes], size: int) -> bytearray:
    """Read `size` bytes, known to be harmless, or what there is of them, piece by piece and without a copy."""
    data = bytearray()
    while piece := stream.read(min(size - len(data), MEBIBYTE)):
        data += piece
    return data


def take(stream: IO[bytes], size: int) -> bytes:
    """Read exactly `size` bytes. Raises EOFError if the stream ends before, ValueError as `available`."""
    data = available(stream, size)
    if len(data) < size:
        raise EOFError(f"{size} bytes expected, {len(data)} found")
    return data


def skip(stream: IO[bytes], size: int) -> None:
    """Read over `size` bytes. Raises EOFError if the stream ends before."""
    while size > 0:
        piece = stream.read(min(size, MEBIBYTE))
        if not piece:
            raise EOFError(f"{size} bytes more expected")
        size -= len(piece)


class Unpacker:
    """Unpacks parts of a file, in sum no more than `allowance`."""

    def __init__(self, path: Path) -> None:
        self._path, self._left = path, allowance(path)

    def unpack(self, method: str, data: bytes) -> bytes:
        """Unpack what "bz2", "lz4", "zstd" or "" (nothing) packed; data cut short give what they can.

        Raises RecordingError if the sum grows too large, and one of DAMAGE if the data are damaged.
        """
        if not method:
            return data
        decompressor = _decompressors()[method]()
        unpacked: bytes = decompressor.decompress(data, min(self._left, MAX_RECORD))
        self._left -= len(unpacked)
        if self._left <= 0:
            raise _too_large(self._path)
        return unpacked


@cache
def _decompressors() -> dict[str, Any]:
    from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

    return {"bz2": bz2.BZ2Decompressor, "lz4": LZ4FrameDecompressor, "zstd": zstd.ZstdDecompressor}


def lines(
    stream: IO[bytes], remark: Callable[[str], None], is_whole: Callable[[bytes], bool] = lambda _: False
) -> Iterator[bytes]:
    """Yield the lines of a text. The last one is left out if it does not end, unless `is_whole` says it lacks nothing.

    A number that was cut looks like one: only a format knows how many digits there should be.
    Raises RecordingError if a line is endless.
    """
    while line := stream.readline(MAX_LINE):
        if not line.endswith(b"\n") and len(line) == MAX_LINE:
            raise RecordingError(
                f"A line is longer than {MAX_LINE // MEBIBYTE} MiB: this is not a text recording."
            )
        if line.endswith(b"\n") or is_whole(line):
            yield line
        else:
            remark("The last line does not end: left out.")
