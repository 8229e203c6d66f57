"""The grid as a picture to look at, with the walls and the path of the sensor drawn over it."""

from io import BytesIO

from PIL import Image, ImageDraw

from lidarcore.arrays import Array
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.grid.ros_map import shades_of
from lidarcore.mapping.walls import Walls

_WALL, _CORNER, _PATH = (200, 30, 30), (20, 60, 200), (60, 160, 190)
_SMALLEST = 1500  # pixels that the longer side should have


def map_png(grid: OccupancyGrid, walls: Walls, path: Array) -> bytes:
    """The picture as PNG, y up; path (T, 2) m."""
    shades = shades_of(grid)
    zoom = max(1, _SMALLEST // max(shades.shape))
    picture = Image.fromarray(shades).convert("RGB")
    picture = picture.resize((picture.width * zoom, picture.height * zoom), Image.Resampling.NEAREST)
    draw = ImageDraw.Draw(picture)
    if len(path) > 1:
        draw.line(_pixels(grid, path, zoom), fill=_PATH, width=1)
    for ends in walls.ends:
        draw.line(_pixels(grid, ends, zoom), fill=_WALL, width=2)
    for x, y in _pixels(grid, walls.corners.xy, zoom):
        draw.ellipse([x - 3, y - 3, x + 3, y + 3], outline=_CORNER)
    file = BytesIO()
    picture.save(file, "PNG")
    return file.getvalue()


def _pixels(grid: OccupancyGrid, xy: Array, zoom: int) -> list[tuple[float, float]]:
    return [(x * zoom, (len(grid.cells) - y) * zoom) for x, y in grid.in_cells(xy).tolist()]
