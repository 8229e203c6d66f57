"""What of a frame is drawn where, and what a click means."""

from collections.abc import Callable, Iterator

import numpy as np
from viser import ViserServer

from app.canvas import Canvas
from app.colours import Rgbs, categorical, method_rgb, turbo
from app.frame import Frame
from app.inks import ink
from app.picking import Picking
from app.scene_map import MapLayers, pose_of
from app.shapes import (
    ARROW,
    CIRCLE,
    CROSS,
    axis_labels,
    beams_between,
    ellipses,
    nice_step,
    polylines,
    wedge,
)
from lidarcore import Features


class Scene:
    """Draws frames for all browsers; call `draw` from one thread."""

    def __init__(
        self,
        server: ViserServer,
        select_corner: Callable[[int], None],
        select_landmark: Callable[[int], None],
    ) -> None:
        """The functions are told the id of a corner or landmark that someone clicked."""
        self._server, self._canvas = server, Canvas(server)
        self._map = MapLayers(self._canvas, self._ink)
        self._picking = Picking(self._canvas, select_corner, select_landmark)
        self._theme = ""
        self._source = -1
        self._reach = 0.0  # m from the sensor to what it sees

    def draw(self, frame: Frame) -> None:
        """Show the frame."""
        with self._server.atomic():
            self._prepare(frame)
            self._canvas.place(pose_of(frame))
            for draw in (
                self._draw_scan,
                self._draw_gaps,
                self._draw_segments,
                self._draw_corners,
                self._draw_clusters,
                self._draw_rejected,
            ):
                draw(frame)
            self._map.draw(frame, self._reach)
        self._server.flush()
        self._picking.frame = frame

    def _ink(self, name: str) -> Rgbs:
        return ink(self._theme, name)

    def _prepare(self, frame: Frame) -> None:
        """What changes only with the theme or with the room: sizes, colours of the ground, labels."""
        theme, source = frame.settings.view.theme, frame.taken.source
        if (theme, source) == (self._theme, self._source):
            return
        if source != self._source:
            distances = np.linalg.norm(frame.scan.xy[frame.scan.valid], axis=1)
            self._reach = max(1.0, 1.1 * float(np.percentile(distances, 98))) if len(distances) else 5.0
            self._canvas.fit(self._reach)
        self._theme, self._source = theme, source
        step = nice_step(self._reach)
        self._canvas.paper(theme == "dark", self._ink("cell"), self._ink("section"), float(step))
        self._canvas.strokes("labels", True, axis_labels(self._reach, step), self._ink("label"))

    def _draw_scan(self, frame: Frame) -> None:
        layers, scan = frame.settings.view.layers, frame.scan
        self._canvas.points("points", layers.points, scan.xy[scan.valid], self._point_colours(frame))
        self._canvas.strokes("sensor", layers.sensor, ARROW * self._reach / 40, self._ink("sensor"))
        for name in ("grid", "labels"):
            self._canvas.visible(name, layers.grid)

    def _draw_gaps(self, frame: Frame) -> None:
        """The sectors whose data were lost on the way, as wedges."""
        outlines = [wedge(start, end) * self._reach for start, end in frame.scan.gaps.tolist()]
        strokes = polylines(np.array(outlines).reshape(-1, *CIRCLE.shape))
        self._canvas.strokes("gaps", frame.settings.view.layers.gaps, strokes, self._ink("rejected"))

    def _point_colours(self, frame: Frame) -> Rgbs:
        """One colour (3,) for all points, or (N, 3)."""
        scan, mode = frame.scan, frame.settings.view.colour
        if mode == "range":
            return turbo(scan.ranges[scan.valid] / self._reach)
        if mode == "quality" and scan.quality is not None:
            quality = scan.quality[scan.valid]
            return turbo(quality / max(float(quality.max(initial=0)), 1e-9))
        if mode == "segment":
            return self._segment_colours(frame)
        return self._ink("points")

    def _segment_colours(self, frame: Frame) -> Rgbs:
        """Every point in the colour of the segment it belongs to (N, 3)."""
        scan, segments = frame.scan, frame.main.segments
        colours = np.tile(self._ink("points"), (len(scan), 1))
        ends = zip(segments.first_beam.tolist(), segments.last_beam.tolist(), strict=True)
        for colour, (first, last) in zip(categorical(len(segments)), ends, strict=True):
            colours[beams_between(scan, first, last)] = colour
        return colours[scan.valid]

    def _draw_segments(self, frame: Frame) -> None:
        found = {name: features.segments for name, features in _main_on_top(frame)}
        strokes = np.concatenate([np.stack([s.start, s.end], 1) for s in found.values()])
        if frame.settings.view.colour == "segment" and len(found) == 1:
            colours = categorical(len(strokes))
        else:
            colours = self._method_colours({name: len(segments) for name, segments in found.items()})
        self._canvas.strokes("segments", frame.settings.view.layers.segments, strokes, colours)

    def _draw_corners(self, frame: Frame) -> None:
        layers, scale = frame.settings.view.layers, frame.settings.view.ellipse_scale
        found = {name: features.corners for name, features in _main_on_top(frame)}
        xy = np.concatenate([corners.xy for corners in found.values()])
        covariance = np.concatenate([corners.covariance for corners in found.values()])
        colours = self._method_colours({name: len(corners) for name, corners in found.items()})
        half, angle, outline = ellipses(xy, covariance, scale)
        strokes, ink = polylines(outline), np.repeat(colours, len(CIRCLE) - 1, 0)
        self._canvas.discs("fill", layers.ellipses, xy, half, angle, colours)
        self._canvas.strokes("outline", layers.ellipses, strokes, ink)
        dots = np.full_like(xy, self._reach / 130)
        self._canvas.discs("markers", layers.corners, xy, dots, np.zeros(len(xy)), colours)
        self._draw_ring(frame)

    def _method_colours(self, counts: dict[str, int]) -> Rgbs:
        return np.concatenate([np.tile(method_rgb(name, self._theme), (n, 1)) for name, n in counts.items()])

    def _draw_ring(self, frame: Frame) -> None:
        where = [xy for id_, xy in frame.corner_positions() if id_ == frame.selection.corner]
        rings = np.array([CIRCLE * self._reach / 28 + xy for xy in where]).reshape(-1, *CIRCLE.shape)
        self._canvas.strokes("ring", True, polylines(rings), self._ink("ring"))

    def _draw_rejected(self, frame: Frame) -> None:
        wanted, scan = frame.settings.view.layers.rejected, frame.scan
        rejections = list(frame.main.rejections) if wanted else []
        pieces = [beams_between(scan, r.first_beam, r.last_beam) for r in rejections if r.kind == "segment"]
        points = scan.xy[np.concatenate(pieces)] if pieces else np.empty((0, 2))
        crosses = [CROSS * self._reach / 90 + r.xy for r in rejections if r.kind == "corner"]
        strokes = np.array(crosses).reshape(-1, 2, 2)
        self._canvas.points("rejected", wanted, points, self._ink("rejected"))
        self._canvas.strokes("crosses", wanted, strokes, self._ink("rejected"))

    def _draw_clusters(self, frame: Frame) -> None:
        """Where the members of each cluster lie: two sigma of their scatter."""
        found = frame.clusters
        visible = frame.settings.view.layers.clusters and found is not None
        means, scatters = (found.means, found.scatters) if found else (np.empty((0, 2)), np.empty((0, 2, 2)))
        half, angle, outline = ellipses(means, scatters, 2.0)
        half = np.maximum(half, self._reach / 200)  # members in a line have an ellipse without a width
        self._canvas.discs(
            "cluster fill", visible, means, half, angle, np.tile(self._ink("cluster"), (len(means), 1))
        )
        self._canvas.strokes("clusters", visible, polylines(outline), self._ink("cluster"))


def _main_on_top(frame: Frame) -> Iterator[tuple[str, Features]]:
    """Names and features, the main one last: what is drawn last is on top."""
    return reversed(frame.features.items())
