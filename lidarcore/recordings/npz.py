"""NumPy archives (.npz) without pickles."""

import re
import zipfile
from collections.abc import Callable, Mapping
from io import BytesIO
from math import prod
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from lidarcore.recordings.arrays import ArrayRecording
from lidarcore.recordings.streams import allowance, take


class NpzArchive(ArrayRecording):
    """Arrays named as in `arrays.EXPECTED`, saved by numpy.savez or savez_compressed."""

    name = "NumPy .npz"
    signature = re.compile(rb"\APK(\x03\x04|\x05\x06)")

    def _load(self, wanted: Callable[[str], bool]) -> Mapping[str, NDArray[Any]]:
        with zipfile.ZipFile(BytesIO(self._content())) as archive:
            names = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            return {name: self._array(archive, info) for name, info in names.items() if wanted(name)}

    def _array(self, archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[Any]:
        """Read one array; numpy.load would trust the shape in its header and allocate it."""
        if info.file_size > allowance(self.path):
            raise self._error(f"claims {info.file_size} bytes of {info.filename}, too many for its own size.")
        with archive.open(info) as member:
            data = BytesIO(take(member, info.file_size))
        version = npy.read_magic(data)
        read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, column_major, dtype = read_header(data)
        if dtype.hasobject:
            raise self._error(f"holds pickled objects ({info.filename}), which can run code: not read.")
        self._check_size(info.filename, shape, dtype.kind in "fiu")
        if prod(shape) * dtype.itemsize != info.file_size - data.tell():
            raise self._error(
                f"has a {info.filename} that claims the shape {shape}, but is not of that size."
            )
        return np.frombuffer(data.read(), dtype).reshape(shape, order="F" if column_major else "C")
