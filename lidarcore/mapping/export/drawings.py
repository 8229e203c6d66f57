"""A map to look at: a floor plan of the walls as SVG and DXF, the grid with the walls over it as PNG."""

import io

import numpy as np
from PIL import Image, ImageDraw

from lidarcore.arrays import Array
from lidarcore.errors import MapFileError
from lidarcore.mapping.grid import OccupancyGrid, shades_of
from lidarcore.mapping.walls import Walls, WallTable, corner_ends

_MARGIN = 1.0  # m around the plan
_PIXELS = 1200  # width at which a browser shows it at first
_BARS = (0.5, 1, 2, 5, 10, 20, 50, 100)  # m, lengths of the scale
_WALL, _CORNER, _PATH = (200, 30, 30), (20, 60, 200), (60, 160, 190)  # colours of the picture
_SMALLEST = 1500  # pixels that its longer side should have
_LAYERS = {"WALLS": 7, "CORNERS": 1, "PATH": 5}  # and their colours in AutoCAD's index


def corner_places(walls: WallTable) -> Array:
    """Where walls meet (C, 2) m; of a map that was kept, where an end of a wall is a corner."""
    if isinstance(walls, Walls):
        return walls.corners.xy
    at, side = corner_ends(walls).T
    places: Array = walls.ends[at, side]
    return places


def plan_svg(ends: Array, corners: Array, path: Array) -> str:
    """A floor plan as an SVG whose unit is the metre, y up, with a scale.

    ends (W, 2, 2) m of walls, corners (C, 2) m where they meet, path (T, 2) m of the sensor; there may be none of each.
    Raises MapFileError if there is nothing to draw.
    """
    low, high = _extent(ends, path)
    width, height = high - low
    lines = "".join(f'<path d="M{_at(a)}L{_at(b)}"/>' for a, b in ends)
    dots = "".join(f'<circle cx="{x:.3f}" cy="{y:.3f}" r=".06"/>' for x, y in corners.tolist())
    way = "L".join(_at(xy) for xy in path)
    bar = max((length for length in _BARS if length <= width / 4), default=_BARS[0])
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_PIXELS}" height="{_PIXELS * height / width:.0f}" '
        f'viewBox="{low[0]:.3f} {-high[1]:.3f} {width:.3f} {height:.3f}">\n<title>Floor plan</title>\n'
        f'<rect x="{low[0]:.3f}" y="{-high[1]:.3f}" width="{width:.3f}" height="{height:.3f}" fill="#fff"/>\n'
        f'<g transform="scale(1 -1)" fill="none" stroke-linecap="round">\n'
        + (f'<path id="path" d="M{way}" stroke="#7ac" stroke-width=".03"/>\n' if way else "")
        + f'<g id="walls" stroke="#222" stroke-width=".06">{lines}</g>\n'
        f'<g id="corners" fill="#c30">{dots}</g>\n</g>\n'
        f'<g id="scale" transform="translate({low[0] + 0.4:.3f} {-low[1] - 0.3:.3f})" stroke="#222">\n'
        f'<path d="M0-.1V.1M0 0H{bar:g}M{bar:g}-.1V.1" fill="none" stroke-width=".04"/>\n'
        f'<text x="{bar + 0.2:g}" y=".12" font-size=".4" font-family="sans-serif" stroke="none">{bar:g} m</text>'
        "\n</g>\n"
        "</svg>\n"
    )


def plan_dxf(ends: Array, corners: Array, path: Array) -> str:
    """The same as a DXF (R2010) in metres, with the layers WALLS, CORNERS and PATH."""
    import ezdxf  # here: importing it takes a second, and a server that starts needs none
    from ezdxf import zoom

    document = ezdxf.new("R2010", units=ezdxf.units.M)
    for name, colour in _LAYERS.items():
        document.layers.add(name, color=colour)
    space = document.modelspace()
    for a, b in ends.tolist():
        space.add_line(a, b, dxfattribs={"layer": "WALLS"})
    for xy in corners.tolist():
        space.add_point(xy, dxfattribs={"layer": "CORNERS"})
    if len(path) > 1:
        space.add_lwpolyline(path.tolist(), dxfattribs={"layer": "PATH"})
    points = np.concatenate([ends.reshape(-1, 2), corners, path])
    if len(points):  # what programs show at first
        low, high = (*points.min(axis=0), 0), (*points.max(axis=0), 0)
        space.reset_extents(low, high)
        # What is written is that of the space, but not where it is the origin.
        document.header["$EXTMIN"], document.header["$EXTMAX"] = low, high
        zoom.window(space, low, high)
    text = io.StringIO()
    document.write(text)
    return text.getvalue()


def map_png(grid: OccupancyGrid, walls: WallTable, path: Array) -> bytes:
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
    for x, y in _pixels(grid, corner_places(walls), zoom):
        draw.ellipse([x - 3, y - 3, x + 3, y + 3], outline=_CORNER)
    file = io.BytesIO()
    picture.save(file, "PNG")
    return file.getvalue()


def _pixels(grid: OccupancyGrid, xy: Array, zoom: int) -> list[tuple[float, float]]:
    return [(x * zoom, (len(grid.cells) - y) * zoom) for x, y in grid.in_cells(xy).tolist()]


def _extent(ends: Array, path: Array) -> tuple[Array, Array]:
    points = np.concatenate([ends.reshape(-1, 2), path])
    if not len(points):
        raise MapFileError("There are no walls and no path: nothing to draw.")
    return points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN


def _at(xy: Array) -> str:
    return f"{xy[0]:.3f} {xy[1]:.3f}"
