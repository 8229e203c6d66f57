"""Occupancy grids as ROS keeps them: an image, and beside it a YAML file that places it (Nav2 map_server)."""

import re
from collections.abc import Callable
from functools import reduce
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError
from pydantic import BaseModel, Field, ValidationError, model_validator
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from lidarcore.arrays import Array, Ints
from lidarcore.errors import GridError, MapFileError
from lidarcore.files import reason, replacing_all
from lidarcore.mapping.grid.occupancy import FREE, OCCUPIED, UNKNOWN, Cells, OccupancyGrid

_BLACK, _GREY, _WHITE = 0, 205, 254  # what map_saver writes for occupied, unknown and free cells
_LONGEST_YAML = 100_000  # bytes
_MOST_PIXELS = 100_000_000
_BYTES_OF_MEMORY = 70_000_000  # that an image may take beside four times the size of its file
_BAND = 1 << 17  # pixels that are looked at together
_OPAQUE = 255
_PGM_HEADER = re.compile(rb"P5(?:\s+(?:#[^\n]*\n\s*)*\d+){3}\s")  # of a binary one, up to the pixels

Finite = Annotated[float, Field(allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]


class _Header(BaseModel):
    """What the YAML file says. Other entries are left alone."""

    image: Annotated[str, Field(min_length=1)]
    resolution: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    origin: tuple[Finite, Finite, Finite]
    negate: bool
    occupied_thresh: Share
    free_thresh: Share
    mode: Literal["trinary", "scale", "raw"] = "trinary"

    @model_validator(mode="after")
    def _check_order(self) -> "_Header":
        if self.free_thresh >= self.occupied_thresh:
            raise ValueError("free_thresh must be below occupied_thresh")
        return self


def read_ros_map(path: str | Path) -> OccupancyGrid:
    """The grid of a YAML file and its image (PGM, PNG, BMP), as Nav2 reads them in the modes trinary, scale and raw.

    With one exception: Nav2 before 2025 wrote unknown cells as grey 205 and a free_thresh of 0.25, by which it reads
    them as free. A trinary image of only the three shades that map_saver writes is read as it was meant.
    Raises MapFileError if a file is missing, is none, is a folder, is damaged or too large, says what makes no sense,
    or if the YAML points to an image outside of its folder.
    """
    path = Path(path)
    if path.is_dir():
        raise MapFileError(f"{path} is a folder: give the YAML file in it, such as {path / 'map.yaml'}.")
    try:
        header = _read_header(path)
        cells = _read_image(_image_beside(path, header.image), header)
        return OccupancyGrid(cells[::-1], header.resolution, np.array(header.origin))
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise MapFileError(f"{path.name} cannot be read: {reason(error)}.") from error


def write_ros_map(grid: OccupancyGrid, path: str | Path) -> None:
    """Write a YAML file and beside it a PGM of the same name, trinary, as Nav2's map_saver does: both, or none.

    Raises MapFileError if the suffix is not .yaml or a file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".yaml":
        raise MapFileError(f"{path.name} should end in .yaml; the image beside it ends in .pgm.")
    image = path.with_suffix(".pgm")
    try:
        with replacing_all(image, path) as (image_part, yaml_part):
            image_part.write_bytes(ros_pgm(grid))
            yaml_part.write_text(ros_yaml(grid, image.name), "utf-8")
    except OSError as error:
        raise MapFileError(f"{path} cannot be written: {reason(error)}.") from error


def ros_pgm(grid: OccupancyGrid) -> bytes:
    """The image alone."""
    height, width = grid.cells.shape
    return b"P5\n%d %d\n255\n" % (width, height) + shades_of(grid).tobytes()


def shades_of(grid: OccupancyGrid) -> NDArray[np.uint8]:
    """Grey values (H, W) as map_saver writes them, the first row at the top."""
    shades = np.where(grid.occupied, _BLACK, np.where(grid.free, _WHITE, _GREY))
    return np.ascontiguousarray(shades.astype(np.uint8)[::-1])


def ros_yaml(grid: OccupancyGrid, image: str) -> str:
    """The YAML text; thresholds between the shades that are written, so that unknown stays unknown."""
    x, y, yaw = grid.origin.tolist()
    return (
        f"image: {image}\nmode: trinary\nresolution: {grid.resolution:.9g}\norigin: [{x:.9g}, {y:.9g}, {yaw:.9g}]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def _read_header(path: Path) -> _Header:
    if path.stat().st_size > _LONGEST_YAML:
        raise MapFileError(f"{path.name} is too long for the YAML of a map: give the .yaml, not the image.")
    try:
        document: Any = YAML(typ="safe", pure=True).load(path.read_text("utf-8"))
        if not isinstance(document, dict):
            raise MapFileError(
                f"{path.name} holds no entries: it should say image, resolution, origin and more."
            )
        return _Header.model_validate(document)
    except ValidationError as error:
        wrong = "; ".join(f"{'.'.join(map(str, e['loc'])) or 'header'}: {e['msg']}" for e in error.errors())
        raise MapFileError(f"{path.name} cannot be used as a map: {wrong}.") from error
    except (YAMLError, RecursionError) as error:
        raise MapFileError(
            f"{path.name} is no valid YAML{_where(error)}: mend it, or save the map anew."
        ) from error


def _where(error: Exception) -> str:
    mark = error.problem_mark if isinstance(error, MarkedYAMLError) else None
    return f" (line {mark.line + 1})" if mark else ""


def _image_beside(path: Path, name: str) -> Path:
    folder = path.parent.resolve()
    image = (folder / name).resolve()
    if not image.is_relative_to(folder):
        raise MapFileError(
            f"{path.name} points to {name}, outside of its folder: put the image beside it and name it alone."
        )
    if not image.exists():
        raise MapFileError(f"{path.name} names the image {name}, which is not there: put it beside it.")
    return image


def _read_image(path: Path, header: _Header) -> Cells:
    """Cells (H, W) of an image, the first row at the top: looked up for each of the shades that occur."""
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


def _trinary(shades: Array, opacity: Array, header: _Header) -> Cells:
    if (opacity < 1).any():
        shades = (3 * shades + opacity) / 4  # as Nav2 does
    cells = _thresholded(_occupancy(shades, header), header)
    saved = np.isin(np.rint(shades * 255), (_BLACK, _GREY, _WHITE)).all()
    if saved:
        cells[np.rint(shades * 255) == _GREY] = UNKNOWN
    return cells


def _scale(shades: Array, opacity: Array, header: _Header) -> Cells:
    occupancy, low, high = _occupancy(shades, header), header.free_thresh, header.occupied_thresh
    between = np.rint((occupancy - low) / (high - low) * 100)
    cells = np.where((occupancy >= low) & (occupancy <= high), between, _thresholded(occupancy, header))
    return np.where(opacity < 1, UNKNOWN, cells).astype(np.int8)


def _raw(shades: Array, opacity: Array, header: _Header) -> Cells:
    values = np.rint(shades * 255)
    return np.where(values <= OCCUPIED, values, UNKNOWN).astype(np.int8)


def _occupancy(shades: Array, header: _Header) -> Array:
    return shades if header.negate else 1.0 - shades


def _thresholded(occupancy: Array, header: _Header) -> Cells:
    free, occupied = occupancy < header.free_thresh, occupancy > header.occupied_thresh
    return np.where(occupied, OCCUPIED, np.where(free, FREE, UNKNOWN)).astype(np.int8)


_MODES: dict[str, Callable[[Array, Array, _Header], Cells]] = {
    "trinary": _trinary,
    "scale": _scale,
    "raw": _raw,
}
