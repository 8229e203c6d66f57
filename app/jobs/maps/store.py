"""The maps of all runs in a file: the running one goes into it beside the live view, which never waits for it."""

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

from lidarcore.errors import MapFileError
from lidarcore.landmarks import LandmarkMap, Session
from lidarcore.localization import Landmarks
from lidarcore.localization import from_stored as landmarks_from_stored
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.walls import JointWalls, WallTable, unpack_covariance

from .landmark_writer import LandmarkWriter
from .repeats import Repeats
from .sent_map import building_of, landmarks_of
from .session_writer import MapChange, SessionWriter
from .wall_writer import (
    WallWriter,
    covariance_to_stored,
    from_stored,
    grid_from_stored,
    grid_to_stored,
    to_stored,
)
from .watched_atlas import WatchedAtlas
from .write_queue import WriteQueue

PATIENCE = 2.0  # s to wait while another process writes


@dataclass(frozen=True, slots=True)
class StoreStatus:
    """The file, the session that is written or used, its landmarks in the file, and how far that is behind, s.

    `error` says why the newest map is not on the disk.
    """

    path: str
    session: int | None
    landmarks: int
    behind_s: float
    error: str | None


class LandmarkStore:
    """An atlas of maps, with a thread that writes the running one.

    listeners  called in that thread with what was written
    """

    def __init__(self, url: str | Path) -> None:
        """Open, or make, the file. Raises LandmarkMapError."""
        self.atlas = WatchedAtlas(url, PATIENCE)
        self.listeners: list[Callable[[MapChange], None]] = []
        self._run: SessionWriter | None = None
        self._used: int | None = None
        self._unpacking = Lock()  # for one map at a time: with many walls it takes 200 MB
        repeats = Repeats(self.atlas, lambda session: session == self._used)
        self._queue = WriteQueue(self._tell, repeats.replace_earlier)

    def close(self) -> None:
        """End the run, wait (bounded) until it is written, and close the file."""
        self.use(None)
        if self._queue.close():  # else the file may still be written to
            self.atlas.close()

    @property
    def status(self) -> StoreStatus:
        """How well the map gets to the disk."""
        run = self._run
        return StoreStatus(
            path=str(self.atlas.path),
            session=self.session,
            landmarks=len(run.ids) if run else 0,
            behind_s=self._queue.behind_s,
            error=self._queue.error,
        )

    @property
    def session(self) -> int | None:
        """The session that is written, or used; None if there is none yet."""
        return self._run.session if self._run else self._used

    def begin(self, source: str, replay: Hashable = None) -> SessionWriter:
        """A run begins with an empty map of its own, and the one before ends.

        Of runs with the same `replay`, which lead to the same map, the last one that was finished is kept; one that saw
        less of it, as it began later or ended sooner, does not take the place of another.
        """
        self.use(None)
        self._run = run = LandmarkWriter(self.atlas, source, self._queue.schedule, replay)
        return run

    def begin_walls(self, source: str, replay: Hashable = None) -> SessionWriter:
        """A run begins with an empty map of walls of its own, and the one before ends; `replay` is as in `begin`."""
        self.use(None)
        self._run = run = WallWriter(self.atlas, source, self._queue.schedule, replay)
        return run

    def walls(self, session: int) -> WallTable:
        """The walls that a session has in the file. Raises UnknownSessionError."""
        return from_stored(self.atlas[session].walls())

    def joint_walls(self, session: int) -> JointWalls | None:
        """The walls that a session has, knowing how they err together; None if that is not kept.

        Raises UnknownSessionError, or MapFileError if it is damaged.
        """
        walls, together = self.atlas[session].walls_together()
        if together is None:
            return None
        with self._unpacking:
            return unpack_covariance(together, from_stored(walls))

    def use(self, session: int | None) -> None:
        """The run ends; questions that name no session are about this one now, or about the newest if it is None."""
        if self._run:
            self._run.end()
        self._run, self._used = None, session

    def settle(self) -> None:
        """The run ends, and is on the disk when this returns, unless that takes seconds: its map may be used next."""
        if self._run:
            self.use(None)
            self._queue.settle(PATIENCE)

    def map(self, session: int | None = None) -> LandmarkMap | None:
        """The map of a session; if none is given that which is written or used, else the newest; None if none is.

        Raises UnknownSessionError.
        """
        session = self.session if session is None else session
        return self.atlas.newest() if session is None else self.atlas[session]

    def landmarks(self, session: int) -> Landmarks:
        """The map of a session to localize in, with the ids of the file. Raises UnknownSessionError."""
        return landmarks_from_stored(self.atlas[session])

    def grid(self, session: int) -> OccupancyGrid | None:
        """The grid that a session has. Raises UnknownSessionError, or MapFileError if it is damaged."""
        stored = self.atlas[session].grid()
        return None if stored is None else grid_from_stored(stored)

    def load(self, path: Path, format: str, source: str, mode: str = "import", name: str = "") -> Session:
        """A file of a map as a session of its own: landmarks in one of FORMATS, or a "zip" of a grid as ROS has it.

        Walls that are in the zip come along. A map of mode "slam" was built, in a frame of its own.

        Raises MapFileError or GridError; nothing is kept of it then.
        So also for a file without landmarks: as the newest map it would be the one that is asked.
        """
        building = building_of(path) if format == "zip" else None
        found = [] if building else landmarks_of(path, format)
        if not (building or found):
            raise MapFileError(f"This {format} holds no landmarks: export a map that has some.")
        now = time.time()
        loaded = self.atlas.begin(source, now, mode, found, name)
        if building:
            grid = grid_to_stored(building.grid)
            found_walls = from_stored([]) if building.walls is None else building.walls
            walls, together = to_stored(found_walls), covariance_to_stored(found_walls)
            loaded.put_walls(walls, grid, together)
        self.atlas.end(loaded.session, now)
        return self.atlas.session(loaded.session)

    def is_built(self, session: int) -> bool:
        """Whether SLAM built the map of a session, in a frame of its own. Raises UnknownSessionError."""
        return self.atlas.session(session).mode == "slam"

    def writes(self, session: int) -> bool:
        """Whether a run goes into this session."""
        return self._run is not None and self._run.session == session

    def newest(self) -> int | None:
        """The newest session to localize in."""
        return self.atlas.newest_to_localize_in()

    def _tell(self, change: MapChange) -> None:
        for listener in self.listeners:
            listener(change)
