"""Repeatability: a sensor that stands still sees the same corners and walls again; does each method know how well?

[WCTLS, Fig. 4] compares ellipse areas over 100 scans; here the ellipses are held against the scatter, too. What is the
same in every scan, such as a bias or most of a wall's unevenness, cannot be seen this way.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from lidarcore.arrays import Array
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.repeatability.scatter import LEAST
from lidarcore.evaluation.repeatability.standstill import moves
from lidarcore.evaluation.repeatability.summary import CornerMethod, Summary, WallMethod, WallSummary
from lidarcore.evaluation.repeatability.wall_tracker import WallRow, WallTracker, told_near
from lidarcore.evaluation.repeatability.window import FeatureWindow
from lidarcore.features import Corners, Features
from lidarcore.geometry import unit_vectors
from lidarcore.lines import FITTERS, Lines
from lidarcore.tracking import CornerRow, Tracker

WINDOW = 100
_FOLLOW = 0.1  # of the way to a new observation that the known place of a feature goes


class Repeatability:
    """The last `window` scans of a sensor that stands still, by several methods; it starts again when the sensor moves.

    standing    it is known to stand still: nothing that changes makes the window start again
    Raises EvaluationError for a window too small to judge a feature in, or a method that does not exist.
    """

    def __init__(
        self, window: int = WINDOW, methods: Iterable[str] = tuple(FITTERS), *, standing: bool = False
    ) -> None:
        self.window, self.methods = window, tuple(dict.fromkeys(methods))
        self._standing = standing
        if window < LEAST:
            raise EvaluationError(f"A window of {window} scans is too short: give at least {LEAST}.")
        if unknown := [name for name in self.methods if name not in FITTERS]:
            raise EvaluationError(f"Unknown methods {unknown}: choose from {', '.join(FITTERS)}.")
        if not self.methods:
            raise EvaluationError(f"No method is given: choose from {', '.join(FITTERS)}.")
        self.corners, self.walls = (FeatureWindow(window, self.methods, noun) for noun in ("corner", "wall"))
        self._corner_tracker = Tracker(memory=window, follow=_FOLLOW)
        self._wall_tracker = WallTracker(memory=window, follow=_FOLLOW)
        self._moved = False

    def __len__(self) -> int:
        """Scans in the window."""
        return len(self.corners)

    def clear(self) -> None:
        """Forget every scan: the sensor was moved, or something was set differently. Ids are never used again."""
        self.corners.clear()
        self.walls.clear()
        self._corner_tracker.forget()
        self._wall_tracker.forget()
        self._moved = False

    def add(self, features: Mapping[str, Features]) -> None:
        """One more scan, as `compare(scan, settings, methods)` gives it.

        Raises EvaluationError if a method is missing in it.
        """
        if missing := [name for name in self.methods if name not in features]:
            raise EvaluationError(
                f"The features lack {', '.join(missing)}: call compare() with every method."
            )
        features = {name: features[name] for name in self.methods}
        corners, walls = self._corner_tracker.rows(features), self._wall_tracker.rows(features)
        of_corners = [_seen(found.corners.xy, found.corners) for found in features.values()]
        self.corners.add(corners, self._table(corners, of_corners))
        lines = [found.lines for found in features.values()]
        table = self._table(walls, [_seen(np.column_stack([one.alpha, one.r]), one) for one in lines])
        near = np.array([row.near for row in walls])
        self.walls.add(walls, told_near(table, near[:, None]))
        if not self._standing:
            self._watch()

    def _table(self, rows: Sequence[CornerRow | WallRow], seen: Sequence[Array]) -> Array:
        """(K, M, OBSERVATION) of the rows, NaN where a method has none, from what each method saw (N, OBSERVATION)."""
        index = np.array([[row.index.get(name, -1) for name in self.methods] for row in rows], np.int64)
        index = index.reshape(-1, len(self.methods))
        begin = np.cumsum([0, *(len(found) for found in seen[:-1])])
        table: Array = np.concatenate(seen)[index + begin]
        table[index < 0] = np.nan
        return table

    def _watch(self) -> None:
        """Start again if corners or walls say that the sensor moved."""
        corners, walls, newest = self.corners.firsts(), self.walls.firsts(), len(self) - 1
        if moves(corners, newest) or moves(replace(walls, table=_feet(walls.table)), newest):
            self.clear()
            self._moved = True
        elif len(self) == self.window:
            self._moved = False

    @property
    def moved(self) -> bool:
        """Whether the sensor moved and the window, which then started again, is not full again."""
        return self._moved

    def summary(self) -> Summary:
        """What the window says now."""
        corners, walls = self.corners.scatter(), self.walls.scatter()
        said = self._said_of_moving()
        return Summary(
            self.window,
            len(self),
            said or self.corners.trouble(corners),
            tuple(CornerMethod(*claims) for claims in self.corners.claims(corners)),
            WallSummary(
                self.window,
                len(self),
                said or self.walls.trouble(walls),
                tuple(WallMethod(*claims) for claims in self.walls.claims(walls)),
            ),
        )

    def deviations(self, corner: int) -> dict[str, Array]:
        """(N, 2) m by method: where it saw the corner of that id, from the mean over the window, the oldest first.

        Raises EvaluationError for a corner that was not seen in the window.
        """
        return self.corners.deviations(corner)

    def wall_deviations(self, wall: int) -> dict[str, Array]:
        """(N, 2) rad, m by method: alpha and r of the wall of that id, from the mean over the window, oldest first.

        Raises EvaluationError for a wall that was not seen in the window.
        """
        return self.walls.deviations(wall)

    def _said_of_moving(self) -> str | None:
        if not self._moved:
            return None
        scans = len(self)
        ago = f"{scans} scan{'s' * (scans > 1)} ago" if scans else "just now"
        return f"The sensor moved {ago}: the window was started again."


def _seen(coordinates: Array, of: Corners | Lines) -> Array:
    """(N, OBSERVATION) of corners or lines that have these coordinates (N, 2)."""
    claims = (c.reshape(-1, 4) for c in (of.covariance_published, of.covariance_consistent))
    return np.column_stack([coordinates, *claims])


def _feet(lines: Array) -> Array:
    """(R, 2) m, the points of lines (alpha, r) next to the sensor."""
    return lines[:, 1:] * unit_vectors(lines[:, 0])
