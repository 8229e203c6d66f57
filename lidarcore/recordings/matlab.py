"""MATLAB files (.mat, versions 5 to 7.2).

Format: MathWorks, "MAT-File Format". scipy.io reads these too, but a damaged file can crash it, and the process.
"""

import re
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarcore.recordings.arrays import ArrayRecording

NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Data types of elements (table 1-1)."""

MATRIX, COMPRESSED = 14, 15
Buffer = bytes | memoryview

NUMERIC_CLASSES = range(6, 16)
COMPLEX = 0x800
BEGINNING = 1 << 12
"""Bytes of a packed matrix that hold all but its numbers."""


class Matrix(NamedTuple):
    """What a matrix says of itself before its numbers."""

    name: str
    shape: tuple[int, ...]
    real: bool


class MatlabFile(ArrayRecording):
    """Matrices named as in `arrays.EXPECTED`, saved by MATLAB's `save` or scipy.io.savemat."""

    name = "MATLAB .mat"
    signature = re.compile(rb"\AMATLAB.{120}(IM|MI)", re.DOTALL)

    def _load(self, wanted: Callable[[str], bool]) -> Mapping[str, NDArray[Any]]:
        content = self._content()
        if content.startswith(b"MATLAB 7.3"):
            raise self._error("is a MATLAB 7.3 (HDF5) file: save it with `save -v7`.")
        order = "<" if content[126:128] == b"IM" else ">"
        found, size = {}, 0
        for kind, packed in _elements(memoryview(content)[128:], order):
            beginning = (
                zlib.decompressobj().decompress(packed, BEGINNING)[8:] if kind == COMPRESSED else packed
            )
            matrix = _describe(beginning, order) if kind in (MATRIX, COMPRESSED) else None
            if matrix is None or not wanted(matrix.name):
                continue
            self._check_size(matrix.name, matrix.shape, matrix.real, 1)  # each number takes a byte or more
            if kind == COMPRESSED:
                unpacked = zlib.decompressobj().decompress(packed, self._most_bytes() + BEGINNING)
                packed, size = memoryview(unpacked)[8:], size + len(unpacked)
            if size > self._most_bytes():
                raise self._error(
                    "unpacks to arrays too large for its own size: save it with `save -nocompression`."
                )
            found[matrix.name] = _numbers(packed, order).reshape(matrix.shape, order="F")
        return found


def _elements(data: Buffer, order: str) -> Iterator[tuple[int, Buffer]]:
    """Yield type and content of each data element. Raises EOFError if one is cut short."""
    position = 0
    while position + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, position)
        start = position + 8
        if kind >> 16:  # the small format: both in the first word, the content in the second
            kind, size, start = kind & 0xFFFF, min(kind >> 16, 4), position + 4
        if start + size > len(data):
            raise EOFError(f"an element of {size} bytes is cut short")
        yield kind, data[start : start + size]
        position = max(start + size, position + 8)
        if kind != COMPRESSED:
            position += -position % 8


def _describe(matrix: Buffer, order: str) -> Matrix:
    (_, flags), (_, shape), (_, name) = islice(_elements(matrix, order), 3)
    (word,) = struct.unpack_from(f"{order}I", flags)
    real = word & 0xFF in NUMERIC_CLASSES and not word & COMPLEX
    return Matrix(
        bytes(name).decode("ascii", "replace"), tuple(np.frombuffer(shape, f"{order}i4").tolist()), real
    )


def _numbers(matrix: Buffer, order: str) -> NDArray[Any]:
    kind, real = next(islice(_elements(matrix, order), 3, None))
    return np.frombuffer(real, order + NUMBERS[kind])
