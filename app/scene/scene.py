"""What of a frame is drawn where."""

from collections.abc import Iterator

import numpy as np
from viser import ViserServer

from lidarcore import Features

from ..pipeline.frame import Frame
from .canvas import Canvas
from .colours import Rgbs, categorical
from .map_layers import MapLayers
from .palette import method_rgb, theme_colour
from .point_colours import point_colours
from .shapes import CIRCLE, beams_between, ellipses, polylines, wedge


class Scene:
    """Draws frames for all browsers; call `draw` from one thread."""

    def __init__(self, server: ViserServer) -> None:
        self._server, self._canvas = server, Canvas(server)
        self._map = MapLayers(self._canvas, self._colour)
        self._theme = ""
        self._source = -1
        self._reach = 0.0  # m from the sensor to what it sees

    def draw(self, frame: Frame) -> None:
        """Show the frame."""
        with self._server.atomic():
            self._prepare(frame)
            self._canvas.place(frame.pose)
            for draw in (
                self._draw_scan,
                self._draw_gaps,
                self._draw_segments,
                self._draw_clusters,
                self._draw_rejected,
            ):
                draw(frame)
            self._map.draw(frame)
        self._server.flush()

    def close(self) -> None:
        """Draw no more."""
        self._map.close()

    def _colour(self, name: str) -> Rgbs:
        return theme_colour(self._theme, name)

    def _prepare(self, frame: Frame) -> None:
        """What changes only with the theme or with the room."""
        theme, source = frame.settings.view.theme, frame.timed.source
        if (theme, source) == (self._theme, self._source):
            return
        if source != self._source:
            distances = np.linalg.norm(frame.scan.xy[frame.scan.valid], axis=1)
            self._reach = max(1.0, 1.1 * float(np.percentile(distances, 98))) if len(distances) else 5.0
            self._canvas.fit(self._reach)
        self._theme, self._source = theme, source
        self._canvas.ground(theme == "dark")

    def _draw_scan(self, frame: Frame) -> None:
        layers, scan = frame.settings.view.layers, frame.scan
        colours = (
            point_colours(frame, self._colour("points")) if frame.is_placed else self._colour("tentative")
        )
        self._canvas.points("points", layers.points, scan.xy[scan.valid], colours)

    def _draw_gaps(self, frame: Frame) -> None:
        """The sectors whose data were lost on the way, as wedges."""
        outlines = [wedge(start, end) * self._reach for start, end in frame.scan.gaps.tolist()]
        strokes = polylines(np.array(outlines).reshape(-1, *CIRCLE.shape))
        self._canvas.strokes("gaps", frame.settings.view.layers.gaps, strokes, self._colour("rejected"))

    def _draw_segments(self, frame: Frame) -> None:
        found = {name: features.segments for name, features in _main_on_top(frame)}
        strokes = np.concatenate([np.stack([s.start, s.end], 1) for s in found.values()])
        if not frame.is_placed:
            colours = self._colour("tentative")
        elif frame.settings.view.colour == "segment" and len(found) == 1:
            colours = categorical(len(strokes))
        else:
            colours = self._method_colours({name: len(segments) for name, segments in found.items()})
        self._canvas.strokes("segments", frame.settings.view.layers.segments, strokes, colours)

    def _method_colours(self, counts: dict[str, int]) -> Rgbs:
        return np.concatenate([np.tile(method_rgb(name, self._theme), (n, 1)) for name, n in counts.items()])

    def _draw_rejected(self, frame: Frame) -> None:
        wanted, scan = frame.settings.view.layers.rejected, frame.scan
        rejections = list(frame.main.rejections) if wanted else []
        pieces = [beams_between(scan, r.first_beam, r.last_beam) for r in rejections if r.kind == "segment"]
        points = scan.xy[np.concatenate(pieces)] if pieces else np.empty((0, 2))
        self._canvas.points("rejected", wanted, points, self._colour("rejected"))

    def _draw_clusters(self, frame: Frame) -> None:
        """Where the members of each cluster lie: two sigma of their scatter."""
        found = frame.clusters
        visible = frame.settings.view.layers.clusters and found is not None
        means, scatters = (found.means, found.scatters) if found else (np.empty((0, 2)), np.empty((0, 2, 2)))
        half, angle, outline = ellipses(means, scatters, 2.0)
        half = np.maximum(half, self._reach / 200)  # members in a line have an ellipse without a width
        self._canvas.discs(
            "cluster fill", visible, means, half, angle, np.tile(self._colour("cluster"), (len(means), 1))
        )
        self._canvas.strokes("clusters", visible, polylines(outline), self._colour("cluster"))


def _main_on_top(frame: Frame) -> Iterator[tuple[str, Features]]:
    """Names and features, the main one last: what is drawn last is on top."""
    return reversed(frame.features.items())
