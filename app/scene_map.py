"""What the scene shows of the map and of the sensor's way through it."""

import time
from collections.abc import Callable

import numpy as np

from app.canvas import Canvas
from app.colours import Rgbs
from app.frame import Frame
from app.run import Where
from app.settings import Layers
from app.shapes import CIRCLE, Array, ellipses, in_world, polylines, text
from app.trails import Paths
from lidarcore.localization import Landmarks

EVERY = 0.5  # s between pictures of the landmarks: they hardly move, and there may be many
FADED = 60.0  # s after which a landmark that is not seen looks its palest
PALEST = 0.45
AT_ORIGIN = np.zeros(3)
NOTHING = np.empty((0, 2, 2))


class MapLayers:
    """Landmarks, trails, pose and associations, in the world frame; `ink` gives the colour of a name."""

    def __init__(self, canvas: Canvas, ink: Callable[[str], Rgbs]) -> None:
        self._canvas, self._ink = canvas, ink
        self._drawn_at = 0.0
        self._looks: dict[str, tuple[object, ...]] = {}

    def draw(self, frame: Frame, reach: float) -> None:
        """Show where the sensor is; without an estimate there is nothing to show."""
        layers, scale = frame.settings.view.layers, frame.settings.view.ellipse_scale
        self._draw_pose(frame.where, layers, scale)
        self._draw_trails(frame.paths, layers)
        self._draw_associations(frame.where, layers)
        self._draw_landmarks(frame, reach)

    def _draw_pose(self, where: Where | None, layers: Layers, scale: float) -> None:
        """The ellipse of the position, and a beam as wide as the heading is uncertain."""
        strokes = NOTHING
        if where is not None:
            estimate = where.whereabouts.estimate
            _, _, outline = ellipses(estimate.pose[None, :2], estimate.covariance[None, :2, :2], scale)
            strokes = polylines(outline)
        self._canvas.strokes("pose", layers.pose, strokes, self._ink("trail"))

    def _draw_trails(self, paths: Paths, layers: Layers) -> None:
        for name, visible, points in (
            ("trail", layers.trail, paths.estimated),
            ("reckoned", layers.dead_reckoned, paths.dead_reckoned),
            ("true", layers.truth, paths.true),
        ):
            colour = self._ink(name)
            if self._changed(name, visible, len(points), points[-1:].tobytes(), colour.tobytes()):
                self._canvas.strokes(name, visible, polylines(points[None]), colour)

    def _draw_associations(self, where: Where | None, layers: Layers) -> None:
        """From where something is seen to the landmark it is taken for; the ambiguous ones in another colour."""
        strokes, colours = [NOTHING], [np.empty((0, 3), np.uint8)]
        if where is not None:
            found = where.whereabouts
            seen = in_world(found.estimate.pose, found.observed.xy)
            for pairs, ink in ((found.pairs, "association"), (found.ambiguous, "ambiguous")):
                place = {id_: at for at, id_ in enumerate(found.landmarks.ids.tolist())}
                rows = [(i, place[id_]) for i, id_ in pairs.tolist() if id_ in place]
                ends = [[seen[i], found.landmarks.points.xy[j]] for i, j in rows]
                strokes.append(np.array(ends).reshape(-1, 2, 2))
                colours.append(np.tile(self._ink(ink), (len(rows), 1)))
        self._canvas.strokes(
            "associations", layers.associations, np.concatenate(strokes), np.concatenate(colours)
        )

    def _draw_landmarks(self, frame: Frame, reach: float) -> None:
        where, view = frame.where, frame.settings.view
        look = (where is None, where and where.session, view, frame.selection.landmark, reach)
        now = time.monotonic()
        if not self._changed("landmarks", *look) and (where is None or now - self._drawn_at < EVERY):
            return
        self._drawn_at = now
        found = where.whereabouts.landmarks if where else None
        visible = view.layers.landmarks and found is not None
        for name in ("landmark fill", "landmarks", "landmark outline", "ids", "landmark ring"):
            self._canvas.visible(name, False)
        if visible and found is not None and len(found.ids):
            self._show(found, frame, reach)

    def _show(self, known: Landmarks, frame: Frame, reach: float) -> None:
        now, scale = frame.scan.stamp, frame.settings.view.ellipse_scale
        ids = [frame.where.stored.get(id_) if frame.where else None for id_ in known.ids.tolist()]
        xy, colours = known.points.xy, self._colours(known, now)
        half, angle, outline = ellipses(xy, known.points.covariance, scale)
        self._canvas.discs("landmark fill", True, xy, half, angle, colours)
        self._canvas.strokes(
            "landmark outline", True, polylines(outline), np.repeat(colours, len(CIRCLE) - 1, 0)
        )
        dots = np.full_like(xy, reach / 160)
        self._canvas.discs("landmarks", True, xy, dots, np.zeros(len(xy)), colours)
        height = reach / 60
        labels = [
            text(str(id_), (x + height / 2, y + height / 2), height)
            for id_, (x, y) in zip(ids, xy.tolist(), strict=True)
            if id_ is not None
        ]
        self._canvas.strokes("ids", True, np.concatenate([NOTHING, *labels]), self._ink("label"))
        chosen = [id_ is not None and id_ == frame.selection.landmark for id_ in ids]
        rings = CIRCLE * reach / 28 + xy[chosen][:, None]
        self._canvas.strokes("landmark ring", True, polylines(rings), self._ink("ring"))

    def _colours(self, known: Landmarks, now: float) -> Rgbs:
        """(L, 3): grey as long as it is tentative, then paler the longer it was not seen."""
        age = np.clip((now - known.last_seen) / FADED, 0, 1)[:, None]
        fresh, pale = self._ink("landmark").astype(float), self._ink("tentative").astype(float)
        colours = fresh + age * (1 - PALEST) * (pale - fresh)
        return np.where(known.confirmed[:, None], colours, pale).astype(np.uint8)

    def _changed(self, name: str, *look: object) -> bool:
        """Whether this layer looks different from when it was drawn last."""
        if self._looks.get(name) == look:
            return False
        self._looks[name] = look
        return True


def pose_of(frame: Frame) -> Array:
    """T_world_sensor (3,) of a frame."""
    return AT_ORIGIN if frame.where is None else frame.where.whereabouts.estimate.pose
