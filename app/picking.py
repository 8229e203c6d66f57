"""What a click in the scene means: the corner and the landmark nearest to it."""

from collections.abc import Callable
from typing import Any

import numpy as np

from app.canvas import Canvas
from app.frame import Frame
from app.scene_map import pose_of
from app.shapes import Array, in_world

Select = Callable[[int], None]
Places = list[tuple[int, Array]]  # ids and (2,) m, world frame

SAME_SPOT = 0.3  # m; a landmark and the corner taken for it lie on top of each other, so one click means both


class Picking:
    """Tells the ids of the corner and the landmark of the frame that someone clicked."""

    def __init__(self, canvas: Canvas, select_corner: Select, select_landmark: Select) -> None:
        self.frame: Frame | None = None
        self._select_corner, self._select_landmark = select_corner, select_landmark
        canvas.on_click("markers", lambda event: self._clicked(event, np.inf, SAME_SPOT))
        canvas.on_click("landmarks", lambda event: self._clicked(event, SAME_SPOT, np.inf))

    def _clicked(self, event: Any, corner_within: float, landmark_within: float) -> None:
        """Select the nearest of each kind, if it is so near (m) to where the floor was clicked."""
        if self.frame is not None and (at := _on_floor(event)) is not None:
            _choose(_corners(self.frame), at, corner_within, self._select_corner)
            _choose(_landmarks(self.frame), at, landmark_within, self._select_landmark)


def _corners(frame: Frame) -> Places:
    pose = pose_of(frame)
    return [(id_, in_world(pose, xy[None])[0]) for id_, xy in frame.corner_positions()]


def _landmarks(frame: Frame) -> Places:
    where = frame.where
    if where is None:
        return []
    known = where.whereabouts.landmarks
    ids = (where.stored.get(id_) for id_ in known.ids.tolist())
    return [(id_, xy) for id_, xy in zip(ids, known.points.xy, strict=True) if id_ is not None]


def _choose(places: Places, at: Array, within: float, select: Select) -> None:
    """Select what is nearest to the spot (2,) m, unless that is further away."""
    distance, id_ = min(((float(np.hypot(*(xy - at))), id_) for id_, xy in places), default=(np.inf, 0))
    if places and distance <= within:
        select(id_)


def _on_floor(event: Any) -> Array | None:
    """Where the ray of a click meets the floor, (2,) m, world frame."""
    origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
    if not np.isfinite([origin, direction]).all() or direction[2] == 0:
        return None
    floor: Array = (origin - direction * origin[2] / direction[2])[:2]
    return floor
