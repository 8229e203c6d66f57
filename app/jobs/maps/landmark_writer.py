"""What of a running map is on the disk, and what should be: the landmarks that changed enough to be written again."""

from collections.abc import Container
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarcore.errors import UnknownLandmarkError, UnknownSessionError
from lidarcore.landmarks import Landmark
from lidarcore.localization import Landmarks

from .session_writer import MapChange, SessionWriter

MOVED = 0.25  # sigma: a landmark that moved so far since it was written is written again,
RESIZED = 0.1  # and one whose variance has changed by this part,
COUNTED = 1.1  # or that was seen so many times as often,
LATER = 10.0  # s, or so long after

Table = NDArray[np.void]  # the columns of Landmark, with the ids of the navigator
_FLOATS = ("x", "y", "var_x", "cov_xy", "var_y")
_TABLE = np.dtype(
    [(name, "f8") for name in _FLOATS]
    + [
        ("kind", "U32"),
        ("method", "U32"),
        ("count", "i8"),
        ("first_seen", "f8"),
        ("last_seen", "f8"),
        ("id", "i8"),
    ]
)


class LandmarkWriter(SessionWriter):
    """Writes the confirmed landmarks of a run."""

    _written: Table = np.empty(0, _TABLE)

    def write(self, landmarks: Landmarks, method: str = "", *, final: bool) -> MapChange | None:
        """Write what changed enough, or everything if it is final; `method` is what found the landmarks.

        What was written, None if there was nothing to write. Raises LandmarkMapError; nothing has changed then.
        """
        now, before = as_table(landmarks, method), self._written
        _, i, j = np.intersect1d(now["id"], before["id"], assume_unique=True, return_indices=True)
        is_due = np.ones(len(now), np.bool_)
        is_due[i] = now[i] != before[j] if final else _changed(before[j], now[i])
        gone = before["id"][~np.isin(before["id"], now["id"])]
        if not is_due.any() and not len(gone):
            return None
        change = self._put(now[is_due], gone.tolist())
        kept = before[~np.isin(before["id"], np.concatenate([gone, now["id"][is_due]]))]
        self._written = np.concatenate([kept, now[is_due]])
        return change

    def _put(self, rows: Table, gone: list[int]) -> MapChange:
        """Write rows, and take out the landmarks with these ids of the navigator."""
        begun = self._begun()
        marks = [Landmark(*(*values, self.ids.get(id))) for *values, id in rows.tolist()]
        removed = tuple(self.ids[id] for id in gone)
        try:
            stored = begun.put(marks, without=removed)
        except UnknownLandmarkError:
            self._keep({landmark.id for landmark in begun})
            raise
        except UnknownSessionError:
            self._keep(set())
            self._map = None
            raise
        ids = dict(zip(rows["id"].tolist(), stored, strict=True))
        self.ids = {id: known for id, known in self.ids.items() if id not in gone} | ids
        written = zip(rows.tolist(), stored, strict=True)
        landmarks = tuple(Landmark(*(*values, id)) for (*values, _), id in written)
        return MapChange(begun.session, landmarks, removed)

    def _keep(self, left: Container[int | None]) -> None:
        """Forget which landmarks are in the file but these ids: someone deleted the others, which are written again."""
        self.ids = {id: known for id, known in self.ids.items() if known in left}
        self._written = self._written[np.isin(self._written["id"], list(self.ids))]


def as_table(landmarks: Landmarks, method: str) -> Table:
    """The confirmed landmarks as a table, a column for each field."""
    which, points = landmarks.confirmed, landmarks.points
    xy, C = points.xy[which], points.covariance[which]
    columns: dict[str, Any] = {
        "x": xy[:, 0], "y": xy[:, 1], "var_x": C[:, 0, 0], "cov_xy": C[:, 0, 1], "var_y": C[:, 1, 1],
        "kind": np.asarray(points.kinds)[which], "method": method, "count": np.maximum(landmarks.counts[which], 1),
        "first_seen": landmarks.first_seen[which], "last_seen": landmarks.last_seen[which],
        "id": landmarks.ids[which],
    }  # fmt: skip
    table = np.empty(len(xy), _TABLE)
    for name, column in columns.items():
        table[name] = column
    return table


def _changed(before: Table, now: Table) -> NDArray[np.bool_]:
    """Which rows are to be written again."""
    dx, dy = now["x"] - before["x"], now["y"] - before["y"]
    xx, xy, yy = before["var_x"], before["cov_xy"], before["var_y"]
    squared = (yy * dx**2 - 2 * xy * dx * dy + xx * dy**2) / (xx * yy - xy**2)
    resized = [np.abs(now[name] - before[name]) > RESIZED * before[name] for name in ("var_x", "var_y")]
    differs = [now[name] != before[name] for name in ("kind", "method")]
    seen = (now["count"] >= COUNTED * before["count"]) & (now["count"] > before["count"])
    later = now["last_seen"] - before["last_seen"] >= LATER
    changed: NDArray[np.bool_] = np.logical_or.reduce([squared > MOVED**2, *resized, *differs, seen, later])
    return changed
