"""A map of landmarks as a picture that ROS navigation reads: PNG, and YAML that places it."""

from pathlib import Path

import numpy as np
from PIL import Image

from lidarcore.errors import MapFileError
from lidarcore.files import reason, replacing, write
from lidarcore.landmarks.landmark_map import LandmarkMap

_UNKNOWN, _OCCUPIED = 205, 0  # grey values as ROS map_server writes them
_MARGIN = 1.0  # m around the landmarks
_MOST_PIXELS = 100_000_000


def export_picture(
    landmark_map: LandmarkMap, path: str | Path, resolution: float = 0.05, most_pixels: int = _MOST_PIXELS
) -> None:
    """Write a PNG and beside it the YAML of ROS map_server: a cell that holds a landmark is occupied, others unknown.

    resolution is in m a pixel. Raises MapFileError for another suffix than .png, an empty map, a resolution that
    makes no picture or too large a one, or files that cannot be written.
    """
    path, extent = Path(path), landmark_map.extent()
    if path.suffix.lower() != ".png":
        raise MapFileError(f"{path.name} should end in .png.")
    if extent is None:
        raise MapFileError("The map is empty: there is nothing to draw.")
    if not 1e-3 <= resolution <= 1e3:
        raise MapFileError(f"The resolution is {resolution} m: give 0.001 to 1000 m a pixel.")
    origin = np.floor((np.array([extent.x_min, extent.y_min]) - _MARGIN) / resolution) * resolution
    size = np.ceil((np.array([extent.x_max, extent.y_max]) + _MARGIN - origin) / resolution).astype(np.int64)
    if size.prod() > most_pixels:
        raise MapFileError(
            f"The picture would have {size[0]} x {size[1]} pixels, more than {most_pixels}: give a coarser resolution."
        )
    xy = np.array([(landmark.x, landmark.y) for landmark in landmark_map])
    column, row = np.floor((xy - origin) / resolution).astype(np.int64).T
    grey = np.full((size[1], size[0]), _UNKNOWN, np.uint8)
    grey[size[1] - 1 - row, column] = _OCCUPIED  # the first row is the top, the largest y
    try:
        with replacing(path) as partial:
            Image.fromarray(grey).save(partial, "PNG")
        write(path.with_suffix(".yaml"), _yaml(path.name, resolution, origin.tolist()))
    except OSError as error:
        raise MapFileError(f"{path} cannot be written: {reason(error)}.") from error


def _yaml(image: str, resolution: float, origin: list[float]) -> str:
    return (
        f"image: '{image}'\nmode: trinary\nresolution: {resolution:.6f}\n"
        f"origin: [{origin[0]:.6f}, {origin[1]:.6f}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
