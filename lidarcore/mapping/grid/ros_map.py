"""Occupancy grids as ROS keeps them: an image, and beside it a YAML file that places it (Nav2 map_server)."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lidarcore.errors import MapFileError
from lidarcore.files import reason, replacing_all
from lidarcore.mapping.grid.occupancy import OccupancyGrid
from lidarcore.mapping.grid.ros_header import read_header
from lidarcore.mapping.grid.ros_image import BLACK, GREY, WHITE, read_image


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
        header = read_header(path)
        cells = read_image(_image_beside(path, header.image), header)
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
    shades = np.where(grid.occupied, BLACK, np.where(grid.free, WHITE, GREY))
    return np.ascontiguousarray(shades.astype(np.uint8)[::-1])


def ros_yaml(grid: OccupancyGrid, image: str) -> str:
    """The YAML text; thresholds between the shades that are written, so that unknown stays unknown."""
    x, y, yaw = grid.origin.tolist()
    return (
        f"image: {image}\nmode: trinary\nresolution: {grid.resolution:.9g}\norigin: [{x:.9g}, {y:.9g}, {yaw:.9g}]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


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
