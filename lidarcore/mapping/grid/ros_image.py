"""The image of a ROS map, as cells: its shades mean what the header beside it says."""

import re
from collections.abc import Callable
from functools import reduce
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from lidarcore.arrays import Array, Ints
from lidarcore.errors import GridError, MapFileError
from lidarcore.files import reason
from lidarcore.mapping.grid.occupancy import FREE, OCCUPIED, UNKNOWN, Cells
from lidarcore.mapping.grid.ros_header import Header

BLACK, GREY, WHITE = 0, 205, 254  # what map_saver writes for occupied, unknown and free cells
_MOST_PIXELS = 100_000_000
_BYTES_OF_MEMORY = 70_000_000  # that an image may take beside four times the size of its file
_BAND = 1 << 17  # pixels that are looked at together
_OPAQUE = 255
_PGM_HEADER = re.compile(rb"P5(?:\s+(?:#[^\n]*\n\s*)*\d+){3}\s")  # of a binary one, up to the pixels


def read_image(path: Path, header: Header) -> Cells:
    """Cells (H, W) of an image, the first row at the top: looked up for each of the shades that occur.

    Raises MapFileError, and GridError if it has too many pixels.
    """
    try:
        with Image.open(path, formats=("PPM", "PNG", "BMP")) as image:
            width, height = image.size
            is_deep = image.mode.startswith("I")
            full = 65535 if is_deep else 3 * _OPAQUE
            _check_size(path, width, height, 6 if is_deep or len(image.getbands()) > 1 else 3)
            _check_length(path, width, height, is_deep)
            rows = max(_BAND // width, 1)
            bands = [(0, top, width, min(top + rows, height)) for top in range(0, height, rows)]
            found = (np.unique(_codes(image.crop(band), is_deep)) for band in bands)
            codes = reduce(np.union1d, found)
            table = np.zeros(codes[-1] + 1, np.int8)
            table[codes] = _MODES[header.mode]((codes >> 8) / full, (codes & _OPAQUE) / _OPAQUE, header)
            cells = np.empty((height, width), np.int8)
            for band in bands:
                cells[band[1] : band[3]] = table[_codes(image.crop(band), is_deep)]
            return cells
    except UnidentifiedImageError as error:
        raise MapFileError(f"{path.name} is not a PGM, PNG or BMP image.") from error
    except (OSError, SyntaxError) as error:  # the latter of a damaged PNG
        raise MapFileError(f"{path.name} cannot be read: {reason(error)}.") from error


def _codes(image: Image.Image, is_deep: bool) -> Ints:
    """A number for each pixel (H, W): brightness (0 to 65535, or the sum of three colours) times 256, plus opacity."""
    pixels: Ints = np.asarray(image if is_deep else image.convert("RGBA")).astype(np.int64)
    brightness: Ints = pixels.clip(0, 65535) if is_deep else pixels[..., :3].sum(axis=-1)
    return brightness << 8 | (_OPAQUE if is_deep else pixels[..., 3])


def _check_size(path: Path, width: int, height: int, bytes_each: int) -> None:
    """Raise GridError if the pixels would take more memory than a file of this size may."""
    most = min((_BYTES_OF_MEMORY + 4 * path.stat().st_size) // bytes_each, _MOST_PIXELS)
    if width * height > most or width > _BAND:
        raise GridError(
            f"{path.name} has {width} x {height} pixels, more than {most}, or than {_BAND} beside each other: use "
            "larger cells, or a PGM of 8 bits."
        )


def _check_length(path: Path, width: int, height: int, is_deep: bool) -> None:
    """Raise MapFileError if a binary PGM holds less or more than the pixels it announces."""
    with path.open("rb") as file:
        header = _PGM_HEADER.match(file.read(1000))
    wanted = width * height * (2 if is_deep else 1)
    if header and (held := path.stat().st_size - header.end()) != wanted:
        raise MapFileError(
            f"{path.name} says {width} x {height} pixels, which take {wanted} bytes, but holds {held}."
        )


def _trinary(shades: Array, opacity: Array, header: Header) -> Cells:
    if (opacity < 1).any():
        shades = (3 * shades + opacity) / 4  # as Nav2 does
    cells = _thresholded(_occupancy(shades, header), header)
    saved = np.isin(np.rint(shades * 255), (BLACK, GREY, WHITE)).all()
    if saved:
        cells[np.rint(shades * 255) == GREY] = UNKNOWN
    return cells


def _scale(shades: Array, opacity: Array, header: Header) -> Cells:
    occupancy, low, high = _occupancy(shades, header), header.free_thresh, header.occupied_thresh
    between = np.rint((occupancy - low) / (high - low) * 100)
    cells = np.where((occupancy >= low) & (occupancy <= high), between, _thresholded(occupancy, header))
    return np.where(opacity < 1, UNKNOWN, cells).astype(np.int8)


def _raw(shades: Array, opacity: Array, header: Header) -> Cells:
    values = np.rint(shades * 255)
    return np.where(values <= OCCUPIED, values, UNKNOWN).astype(np.int8)


def _occupancy(shades: Array, header: Header) -> Array:
    return shades if header.negate else 1.0 - shades


def _thresholded(occupancy: Array, header: Header) -> Cells:
    free, occupied = occupancy < header.free_thresh, occupancy > header.occupied_thresh
    return np.where(occupied, OCCUPIED, np.where(free, FREE, UNKNOWN)).astype(np.int8)


_MODES: dict[str, Callable[[Array, Array, Header], Cells]] = {
    "trinary": _trinary,
    "scale": _scale,
    "raw": _raw,
}
