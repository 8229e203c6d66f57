"""The maps of all runs in a file: the running one goes into it beside the live view, which never waits for it."""

import logging
import threading
import time
from collections.abc import Callable, Hashable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from lidarcore.errors import LidarError, MapFileError, UnknownLandmarkError, UnknownSessionError
from lidarcore.landmarks import Atlas, LandmarkMap, Session
from lidarcore.localization import Landmarks
from lidarcore.localization import from_stored as landmarks_from_stored
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.walls import WallTable
from lidarcore.threads import join

from .map_file import grid_of, landmarks_of
from .map_writer import MapChange, MapWriter
from .stored_grids import grid_from_stored, grid_to_stored
from .wall_writer import WallWriter, from_stored

PATIENCE = 2.0  # s to wait while another process writes
PAUSE = 0.25  # s between two transactions: how far the disk may be behind
RETRY = 1.0  # s after one that failed
MOST_RUNS = 8  # that have something waiting to be written
END_WITHIN = 10.0  # s that a slow disk may take for what waits

logger = logging.getLogger(__name__)


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


@dataclass(frozen=True, slots=True)
class _Waiting:
    """What writes the newest map of a run, for the last time or not, and since when something has waited for that."""

    write: Callable[[bool], MapChange | None]
    ended: bool
    since: float


class _StoredRun:
    """One run of SLAM as it goes into the file. Every method returns at once.

    `replay` is equal for runs that lead to the same map, as when a recording is repeated; else None.
    """

    def __init__(
        self,
        writer: MapWriter | WallWriter,
        schedule: Callable[["_StoredRun", _Waiting], None],
        replay: Hashable = None,
    ) -> None:
        self.writer, self.replay, self._schedule = writer, replay, schedule
        self._newest: Callable[[bool], MapChange | None] | None = None

    @property
    def session(self) -> int | None:
        """The session in the file; None until something of the map is on the disk."""
        return self.writer.session

    @property
    def ids(self) -> Mapping[int, int]:
        """Ids in the file of the landmarks on the disk, by those of the navigator."""
        return self.writer.ids

    def end(self) -> None:
        """Write what is left, and that the run has ended."""
        if self._newest:
            self._schedule(self, _Waiting(self._newest, ended=True, since=time.monotonic()))

    def _put(self, write: Callable[[bool], MapChange | None]) -> None:
        self._newest = write
        self._schedule(self, _Waiting(write, ended=False, since=time.monotonic()))


class LandmarkRun(_StoredRun):
    """A map of landmarks."""

    writer: MapWriter

    def put(self, landmarks: Landmarks, method: str = "") -> None:
        """Write the map as it is now, unless a newer one comes first; `method` is what found its landmarks."""
        self._put(partial(self.writer.write, landmarks, method))


class WallRun(_StoredRun):
    """A map of walls."""

    writer: WallWriter

    def put(self, grid: OccupancyGrid, walls: WallTable) -> None:
        """Write grid and confirmed walls as they are now, unless newer ones come first."""
        self._put(partial(self.writer.write, grid, walls))


class LandmarkStore:
    """An atlas of maps, with a thread that writes the running one.

    listeners  called in that thread with what was written
    error      why the newest map is not on the disk, in a sentence; None as long as it works
    """

    def __init__(self, url: str | Path) -> None:
        """Open, or make, the file. Raises LandmarkMapError."""
        self.atlas = Atlas(url, PATIENCE)
        self.listeners: list[Callable[[MapChange], None]] = []
        self.error: str | None = None
        self._run: _StoredRun | None = None
        self._used: int | None = None
        self._finished: dict[Hashable, int] = {}  # by what is replayed, the session of its last finished map
        self._waiting: dict[_StoredRun, _Waiting] = {}
        self._writing: _Waiting | None = None
        self._news = threading.Condition()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._work, name="landmarks", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the run, wait (bounded) until it is written, and close the file."""
        self.use(None)
        self._closing.set()
        with self._news:
            self._news.notify()
        if join(self._thread, END_WITHIN):  # else the file may still be written to
            self.atlas.close()

    @property
    def status(self) -> StoreStatus:
        """How well the map gets to the disk."""
        with self._news:
            waiting = [*self._waiting.values(), *([self._writing] if self._writing else [])]
        run = self._run
        return StoreStatus(
            path=str(self.atlas.path),
            session=self.session,
            landmarks=len(run.ids) if run else 0,
            behind_s=max((time.monotonic() - one.since for one in waiting), default=0.0),
            error=self.error,
        )

    @property
    def session(self) -> int | None:
        """The session that is written, or used; None if there is none yet."""
        return self._run.session if self._run else self._used

    def begin(self, source: str, mode: str = "slam", replay: Hashable = None) -> LandmarkRun:
        """A run begins with an empty map of its own, and the one before ends.

        Of runs with the same `replay`, which lead to the same map, the last one that was finished is kept.
        """
        self.use(None)
        self._run = run = LandmarkRun(MapWriter(self.atlas, source, mode), self._schedule, replay)
        return run

    def begin_walls(self, source: str, replay: Hashable = None) -> WallRun:
        """A run begins with an empty map of walls of its own, and the one before ends; `replay` is as in `begin`."""
        self.use(None)
        self._run = run = WallRun(WallWriter(self.atlas, source, "slam"), self._schedule, replay)
        return run

    def walls(self, session: int) -> WallTable:
        """The walls that a session has in the file. Raises UnknownSessionError."""
        return from_stored(self.atlas[session].walls())

    def use(self, session: int | None) -> None:
        """The run ends; questions that name no session are about this one now, or about the newest if it is None."""
        if self._run:
            self._run.end()
        self._run, self._used = None, session

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

    def load(self, path: Path, format: str, name: str) -> Session:
        """A file of a map as a session of its own: landmarks in one of FORMATS, or a "zip" of a grid as ROS has it.

        Raises MapFileError or GridError; nothing is kept of it then.
        So also for a file without landmarks: as the newest map it would be the one that is asked.
        """
        grid = grid_of(path) if format == "zip" else None
        found = [] if grid else landmarks_of(path, format)
        if not (grid or found):
            raise MapFileError(f"This {format} holds no landmarks: export a map that has some.")
        now = time.time()
        loaded = self.atlas.begin(name, now, "import", found)
        if grid:
            loaded.put_grid(grid_to_stored(grid))
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

    def _schedule(self, run: _StoredRun, newest: _Waiting) -> None:
        """Have the newest map of a run written in its turn; that the run has ended is not forgotten."""
        with self._news:
            before = self._waiting.pop(run, newest)
            self._waiting[run] = replace(newest, since=before.since, ended=newest.ended or before.ended)
            while len(self._waiting) > MOST_RUNS:
                del self._waiting[next(iter(self._waiting))]
            self._news.notify()

    def _work(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._waiting or self._closing.is_set())
                if not self._waiting:
                    return
                run = next(iter(self._waiting))
                self._writing = waiting = self._waiting.pop(run)
            is_last = self._closing.is_set()
            pause = self._attempt(run, waiting)
            self._writing = None
            if is_last and self.error:
                return
            self._closing.wait(pause)

    def _attempt(self, run: _StoredRun, waiting: _Waiting) -> float:
        """Write, and tell; how long to wait before the next time, s."""
        try:
            change = waiting.write(waiting.ended)
            if waiting.ended:
                run.writer.end()
                self._replace_earlier(run)
            self.error = None
            if change:
                self._tell(change)
        except LidarError as error:
            return self._put_back(run, waiting, error)
        except Exception:
            logger.exception("the map could not be written")
            self.error = "The map is not written: the log of the server says why."
            return RETRY
        return PAUSE if change else 0.0

    def _replace_earlier(self, run: _StoredRun) -> None:
        """Give up the map of the run before with the same `replay`, unless it is in use."""
        if run.replay is None or run.session is None:
            return
        earlier, self._finished[run.replay] = self._finished.get(run.replay), run.session
        if earlier is not None and earlier not in (self._used, run.session):
            with suppress(UnknownSessionError):  # somebody else gave it up
                self.atlas.delete(earlier)

    def _tell(self, change: MapChange) -> None:
        for listener in self.listeners:
            listener(change)

    def _put_back(self, run: _StoredRun, waiting: _Waiting, error: LidarError) -> float:
        """A run waits on if nothing newer does; but a deleted map does not come back when its run has ended."""
        is_deleted = isinstance(error, UnknownLandmarkError | UnknownSessionError)
        if not (is_deleted and waiting.ended):
            with self._news:
                self._waiting[run] = replace(self._waiting.get(run, waiting), since=waiting.since)
        self.error = None if is_deleted else str(error)
        return PAUSE if is_deleted else RETRY
