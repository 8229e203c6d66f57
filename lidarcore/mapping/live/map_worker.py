"""The back of the live map, in a thread of its own: loops, grid and walls, none of which a scan waits for."""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lidarcore.errors import GridError, LocalizationError
from lidarcore.geometry import UncertainPose, compose, pose_difference
from lidarcore.localization.tracking_result import State
from lidarcore.mapping.grid import GridBuilder, GridSettings, OccupancyGrid
from lidarcore.mapping.live.background import Background, Corrected, MapPicture
from lidarcore.mapping.live.worker import Worker
from lidarcore.mapping.loops.back import BackEnd
from lidarcore.mapping.settings import VAGUE, MapperSettings
from lidarcore.mapping.tracked import Tracked
from lidarcore.mapping.walls import WallIds, Walls, find_walls
from lidarcore.settings import ExtractionSettings
from lidarcore.threads import FailureLog

_EVERY = 1.0  # s between two pictures of the map, at least
_REST = 10.0  # times as long as the walls took to find, they are not sought again
_STANDING = 3.0  # s for which they are not either while no keyframe comes
_THINNED_EVERY = 50  # keyframes
_TURNED = 0.005  # rad by which a keyframe turns until the grid is drawn anew: a cell at 10 m
_MOST_CELLS = 16_000_000  # of the grid; a larger building gets larger cells
_NOT_CONNECTED = "The scan lies on nothing known: odometry or the last motion alone says where the sensor is."
_ISLAND = (
    "After a break without odometry the sensor may be in several places: what is mapped now is joined to what was "
    "mapped before once it comes to a place that it has seen."
)
_NOT_PLACED = "A map of whole scans begins where its first scan was taken and cannot be moved."


class MapWorker(Background):
    """Takes keyframes and makes a map of them.

    keep  called with grid and walls, in the thread of the map, each time that walls were found, and at the end
    """

    mode = "slam"

    def __init__(
        self,
        settings: MapperSettings,
        extraction: ExtractionSettings,
        keep: Callable[[OccupancyGrid, Walls], None] | None = None,
    ) -> None:
        self._keep = keep
        self.corrected = Corrected(1, np.zeros((1, 3)), np.zeros((3, 3)))
        self.picture = None
        self._extraction = extraction
        self._back = BackEnd(settings)
        self._begin_grid(GridSettings(most_cells=_MOST_CELLS))
        self._wall_ids = WallIds()
        self._next_picture = self._next_walls = self._wait = 0.0
        self._known = self._walled = 0  # up to which of the scans grid or walls should know, and walls do
        self._failures = FailureLog("the map could not be brought up to date")
        self._worker = Worker(self._work, "map", idle=_EVERY, last=self._finish)

    def place(self, T_map_keyframe: UncertainPose) -> None:
        """Raises LocalizationError: the map begins at its first scan, and cannot be moved."""
        raise LocalizationError(_NOT_PLACED)

    def renew(self, extraction: ExtractionSettings) -> None:
        """Find walls so from here on, also those of the scans that the map has."""
        self.put(extraction)

    def judge(self, tracked: Tracked, here: UncertainPose) -> tuple[State, str | None]:
        """Lost where the scan lies on nothing known, or the sensor may be in several places."""
        if here.covariance[2, 2] > VAGUE**2:
            return "lost", _ISLAND
        return ("tracking", None) if tracked.on else ("lost", _NOT_CONNECTED)

    def _work(self, item: Tracked | ExtractionSettings | None, waiting: int) -> None:
        with self._failures():
            self._step(item, waiting)

    def _step(self, item: Tracked | ExtractionSettings | None, waiting: int) -> None:
        if isinstance(item, ExtractionSettings):
            self._extraction, self._walled = item, 0
        elif item is not None:
            self._add(item)
        now = time.monotonic()
        lacks = self._drawn_to < self._known or self._lacks_walls(now)
        if lacks and now >= self._next_picture:
            self._draw()

    def _lacks_walls(self, now: float) -> bool:
        return self._walled < self._known and now >= self._next_walls + self._wait

    def _finish(self) -> None:
        """What is kept knows all keyframes that were added, also those since walls were sought last."""
        self._next_walls = self._wait = 0.0
        with self._failures():
            if self._keep and self._walled < self._known:
                self._draw()

    def _add(self, tracked: Tracked) -> None:
        self._back.add(tracked)
        if tracked.keyframe or tracked.view:
            self._known = tracked.number + 1
        if tracked.keyframe:
            self._wait = 0.0
        graph = self._back.graph
        self.corrected = Corrected(len(graph), graph.poses, graph.covariance(len(graph) - 1))
        if len(graph) % _THINNED_EVERY == 0:
            self._back.thin()
        if tracked.first is not None:
            self._begin_grid(self._builder.settings)
            self._walled, self._wait = 0, 0.0

    def _draw(self) -> None:
        self._next_picture = time.monotonic() + _EVERY
        try:
            self._bring_up_to_date()
        except GridError:  # too large for such cells
            finer = self._builder.settings
            self._begin_grid(replace(finer, resolution=2 * finer.resolution))
            self._bring_up_to_date()
        grid = self._builder.grid()
        self.picture = MapPicture(grid, self.picture.walls if self.picture else None)
        begin = time.monotonic()
        if self._lacks_walls(begin):
            self.picture = MapPicture(grid, walls := self._walls(grid))
            self._walled = self._drawn_to
            if self._keep:
                self._keep(grid, walls)
            end = time.monotonic()
            self._next_walls, self._wait = end + _REST * (end - begin), _STANDING

    def _begin_grid(self, settings: GridSettings) -> None:
        self._builder, self._drawn, self._drawn_to = GridBuilder(settings), np.empty((0, 3)), 0

    def _bring_up_to_date(self) -> None:
        """Add to the grid the scans that it lacks; draw it anew if loops have moved those that it has."""
        poses, settings = self._back.graph.poses, self._builder.settings
        off = pose_difference(poses[: len(self._drawn)], self._drawn)
        if (np.abs(off) > [settings.resolution, settings.resolution, _TURNED]).any():
            self._begin_grid(settings)
        self._drawn = np.vstack([self._drawn, poses[len(self._drawn) :]])
        for view in self._back.views:
            if view.number >= self._drawn_to:
                self._builder.add(view.scan, compose(self._drawn[view.node], view.tie.pose))
                self._drawn_to = view.number + 1

    def _walls(self, grid: OccupancyGrid) -> Walls:
        graph, views = self._back.graph, self._back.views
        nodes, numbers = np.array([(view.node, view.number) for view in views]).T
        ties = UncertainPose(*(np.array(part) for part in zip(*(view.tie for view in views), strict=True)))
        placed = UncertainPose(graph.poses[nodes], graph.covariances()[nodes]).compose(ties)
        scans = [view.scan for view in views]
        found = find_walls(scans, *placed, grid, extraction=self._extraction, numbers=numbers)
        return self._wall_ids.identified(found)
