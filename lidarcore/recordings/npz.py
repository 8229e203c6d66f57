"""NumPy archives (.npz) without pickles."""

import re
import zipfile
from collections.abc import Callable, Iterable, Mapping
from io import BytesIO
from math import prod
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from lidarcore.files.streams import gathered, is_packed
from lidarcore.recordings.arrays import ArrayRecording


class NpzArchive(ArrayRecording):
    """Arrays named as in `arrays.EXPECTED`, saved by numpy.savez or savez_compressed."""

    name = "NumPy .npz"
    signature = re.compile(rb"\APK(\x03\x04|\x05\x06)")

    def _load(self, wanted: Callable[[str], bool]) -> Mapping[str, NDArray[Any]]:
        with self._seekable() as file, zipfile.ZipFile(file) as archive:
            names = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            chosen = {name: info for name, info in names.items() if wanted(name)}
            if names and not chosen and not any(name.endswith(".npy") for name in archive.namelist()):
                raise self._error(
                    "is a zip of other files, not of NumPy arrays: unpack it and open what is in it. "
                    "Of a ROS 2 bag that is its folder, or in the page its .db3 or .mcap file."
                )
            self._check_sizes(chosen.values())
            return {name: self._array(archive, info) for name, info in chosen.items()}

    def _seekable(self) -> IO[bytes]:
        """The file itself, or what it unpacks to."""
        file = self.path.open("rb")
        if not is_packed(file.read(4)):
            return file
        file.close()
        return BytesIO(self._content())

    def _check_sizes(self, infos: Iterable[zipfile.ZipInfo]) -> None:
        size = sum(info.file_size for info in infos)
        if size > self._most_bytes():
            raise self._error(
                f"claims {size} bytes of arrays, too many for its own size: if you trust it, save it with numpy.savez."
            )

    def _array(self, archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[Any]:
        """Read one array; numpy.load would trust the shape in its header and allocate it."""
        with archive.open(info) as member:
            version = npy.read_magic(member)
            read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
            shape, column_major, dtype = read_header(member)
            size = info.file_size - member.tell()
            data = gathered(member, size)
        if dtype.hasobject:
            raise self._error(f"holds pickled objects ({info.filename}), which can run code: not read.")
        self._check_size(info.filename, shape, dtype.kind in "fiu", dtype.itemsize)
        if len(data) < size:
            raise EOFError(f"{info.filename} is cut short")
        if prod(shape) * dtype.itemsize != size:
            raise self._error(
                f"has a {info.filename} that claims the shape {shape}, but is not of that size."
            )
        return np.frombuffer(data, dtype).reshape(shape, order="F" if column_major else "C")
