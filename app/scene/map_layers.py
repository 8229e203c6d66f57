"""What the scene shows of the map and of the sensor's way through it."""

from collections.abc import Callable
from functools import partial

import numpy as np

from lidarcore.geometry import act, compose
from lidarcore.mapping import MapPicture
from lidarcore.mapping.grid import OccupancyGrid

from ..pipeline.frame import Frame
from ..pipeline.settings import Layers
from ..pipeline.slam_run import Localization
from ..pipeline.trails import Paths
from .canvas import Canvas
from .colours import Rgbs
from .painter import Painter
from .shapes import polylines

NOTHING = np.empty((0, 2, 2))


class MapLayers:
    """Trails, building and associations, in the world frame; `colour` gives that of a name."""

    def __init__(self, canvas: Canvas, colour: Callable[[str], Rgbs]) -> None:
        self._canvas, self._colour, self._painter = canvas, colour, Painter()
        self._looks: dict[str, tuple[object, ...]] = {}

    def close(self) -> None:
        """Paint no more."""
        self._painter.close()

    def draw(self, frame: Frame) -> None:
        """Show where the sensor has been and what it has built; without an estimate there is nothing to show."""
        layers = frame.settings.view.layers
        self._draw_trails(frame.paths, layers)
        self._draw_building(frame.picture, layers, frame.settings.view.theme)
        self._draw_associations(frame.localization, layers)

    def _draw_trails(self, paths: Paths, layers: Layers) -> None:
        for name, visible, points in (
            ("trail", layers.trail, paths.estimated),
            ("reckoned", layers.dead_reckoned, paths.dead_reckoned),
            ("true", layers.truth, paths.true),
        ):
            colour = self._colour(name)
            if self._changed(name, visible, len(points), points[-1:].tobytes(), colour.tobytes()):
                self._canvas.strokes(name, visible, polylines(points[None]), colour)

    def _draw_building(self, picture: MapPicture | None, layers: Layers, theme: str) -> None:
        """Where something stands and where one can go, and the walls."""
        if self._changed("building", picture, layers.occupancy, layers.walls, theme):
            walls = NOTHING if picture is None or picture.walls is None else picture.walls.ends
            self._canvas.strokes("walls", layers.walls, walls, self._colour("wall"))
            if picture is None or not layers.occupancy:
                self._painter.paint(partial(self._canvas.visible, "occupancy", False))
            else:
                free, occupied = self._colour("free"), self._colour("occupied")
                self._painter.paint(partial(self._show_grid, picture.grid, free, occupied))

    def _show_grid(self, grid: OccupancyGrid, free: Rgbs, occupied: Rgbs) -> None:
        pixels = np.zeros((*grid.cells.shape, 4), np.uint8)  # what is unknown is transparent
        pixels[grid.free] = (*free, 255)
        pixels[grid.occupied] = (*occupied, 255)
        size = np.array(grid.cells.shape[::-1]) * grid.resolution
        middle = compose(grid.origin, np.array([*(size / 2), 0.0]))
        self._canvas.picture("occupancy", pixels, (float(size[0]), float(size[1])), middle)

    def _draw_associations(self, localization: Localization | None, layers: Layers) -> None:
        """Lines from where something is seen to the landmark it is taken for; ambiguous ones in another colour."""
        strokes, colours = [NOTHING], [np.empty((0, 3), np.uint8)]
        if localization is not None:
            found = localization.tracking
            seen = act(found.estimate.pose, found.observed.xy)
            for pairs, name in ((found.pairs, "association"), (found.ambiguous, "ambiguous")):
                place = {id_: at for at, id_ in enumerate(found.landmarks.ids.tolist())}
                rows = [(i, place[id_]) for i, id_ in pairs.tolist() if id_ in place]
                ends = [[seen[i], found.landmarks.points.xy[j]] for i, j in rows]
                strokes.append(np.array(ends).reshape(-1, 2, 2))
                colours.append(np.tile(self._colour(name), (len(rows), 1)))
        self._canvas.strokes(
            "associations", layers.associations, np.concatenate(strokes), np.concatenate(colours)
        )

    def _changed(self, name: str, *look: object) -> bool:
        """Whether this layer looks different from when it was drawn last."""
        if self._looks.get(name) == look:
            return False
        self._looks[name] = look
        return True
