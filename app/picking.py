"""What a click in the scene means: the corner, or the landmark, nearest to it."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from app.canvas import Canvas
from app.frame import Frame
from app.scene_map import pose_of
from app.shapes import Array
from lidarcore.poses import compose, inverse

Select = Callable[[int], None]


class Picking:
    """Tells the id of a corner or landmark of the frame that someone clicked."""

    def __init__(self, canvas: Canvas, select_corner: Select, select_landmark: Select) -> None:
        self.frame: Frame | None = None
        self._select_corner, self._select_landmark = select_corner, select_landmark
        canvas.on_click("markers", self._clicked_corner)
        canvas.on_click("landmarks", self._clicked_landmark)

    def _clicked_corner(self, event: Any) -> None:
        if self.frame is not None and (at := _on_floor(event)) is not None:
            in_sensor = compose(inverse(pose_of(self.frame)), np.append(at, 0.0))[:2]
            _choose(self.frame.corner_positions(), in_sensor, self._select_corner)

    def _clicked_landmark(self, event: Any) -> None:
        where = self.frame.where if self.frame else None
        if where is not None and (at := _on_floor(event)) is not None:
            known = where.whereabouts.landmarks
            ids = (where.stored.get(id_) for id_ in known.ids.tolist())
            positions = [(id_, xy) for id_, xy in zip(ids, known.points.xy, strict=True) if id_ is not None]
            _choose(positions, at, self._select_landmark)


def _choose(positions: Iterable[tuple[int, Array]], at: Array, select: Select) -> None:
    """Select what is nearest to the spot (2,) m."""
    nearest = min(positions, key=lambda row: float(np.hypot(*(row[1] - at))), default=None)
    if nearest is not None:
        select(nearest[0])


def _on_floor(event: Any) -> Array | None:
    """Where the ray of a click meets the floor, (2,) m, world frame."""
    origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
    if not np.isfinite([origin, direction]).all() or direction[2] == 0:
        return None
    floor: Array = (origin - direction * origin[2] / direction[2])[:2]
    return floor
