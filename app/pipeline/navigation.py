"""Where the sensor is, from scan to scan: the navigator of the current run, what feeds it and what it leaves behind."""

import threading
from collections.abc import Callable
from dataclasses import replace

from numpy.typing import ArrayLike

from lidarcore import Array, Features, Scan
from lidarcore.clusters import Clusters
from lidarcore.errors import LandmarkMapError, UnknownSessionError
from lidarcore.geometry import check_covariance
from lidarcore.localization import as_pose
from lidarcore.mapping import MapPicture, WholeScans

from ..errors import ConflictError
from ..sources.odometry_feed import OdometryFeed
from ..sources.timed_scan import TimedScan
from .map_store import MapStore
from .new_run import building, localizing
from .settings import LiveNavigation, Method, Settings
from .slam_run import Localization, Run
from .trails import NO_PATHS, Paths, TrackedPose

SIGMA_POSITION, SIGMA_HEADING = 0.2, 0.15  # m, rad: of a pose that someone points out on a map
Extent = tuple[tuple[float, float], tuple[float, float]]

GONE = "There is no session {} any more: choose another map, or build one by SLAM."
NOT_MOVED = (
    "A map of whole scans begins where its first scan was taken: POST /localization/reset starts a new map. "
    'To place the sensor, set navigation.method to "landmarks".'
)
NOT_LOCALIZED = "Nothing is localized: set navigation.mode to slam or localize."


class Navigation:
    """Feeds the navigator with scans from the worker's thread; the rest may be called from any thread."""

    def __init__(self, store: MapStore) -> None:
        self.odometry = OdometryFeed()
        self.problem: str | None = None
        self.runs = 0  # that have begun
        # Told of other walls of a map that is made, from a thread of its own.
        self.map_listeners: list[Callable[[], None]] = []
        self._store = store
        self._map: int | None = None
        self._is_map_used = False  # since it was chosen
        self._is_map_gone = False
        self._run: Run | None = None
        self._placed: tuple[Array, ArrayLike] | None = None
        self._lock = threading.RLock()

    @property
    def session(self) -> int | None:
        """The session of the map that is built, or localized in."""
        run = self._run
        return run.session if run else None

    @property
    def method(self) -> Method | None:
        """What tells the pose; None before the first scan of a run."""
        run = self._run
        return None if run is None else "scans" if isinstance(run.navigator, WholeScans) else "landmarks"

    @property
    def map(self) -> int | None:
        """The session chosen to localize in; None for the newest. SLAM ends a choice that was used before.

        A choice of what is deleted ends, too, when it is localized in no longer.
        """
        return self._map

    @property
    def trajectory(self) -> list[TrackedPose]:
        """All poses of this run that are kept. Who asks does not wait for a scan."""
        run = self._run
        return list(run.trails.trajectory.copy()) if run else []  # one step, whoever appends meanwhile

    @property
    def paths(self) -> Paths:
        """Where the sensor has been in this run."""
        run = self._run
        return run.paths if run else NO_PATHS

    @property
    def picture(self) -> MapPicture | None:
        """Grid and walls, as far as they are known: SLAM from whole scans makes them."""
        run = self._run
        return run.picture if run else None

    @property
    def extent(self) -> Extent | None:
        """What is known of the grid that is localized in, m: from and to along x, then along y."""
        run = self._run
        known = run.picture.grid.extent if run and run.known is not None and run.picture else None
        if known is None:
            return None
        along_x, along_y = known.round(4).tolist()
        return tuple(along_x), tuple(along_y)

    def choose_map(self, session: int | None) -> None:
        """Localize in the map of that session. Raises UnknownSessionError."""
        if session is not None:
            self._store.is_built(session)
        with self._lock:
            self._map, self._is_map_used, self._is_map_gone = session, False, False
            if self._run and self._run.known is not None:
                self._drop_run()

    def leave_map(self, session: int) -> None:
        """The map of a session is gone: whoever is localized in it is so no longer, and is told by the next scan."""
        with self._lock:
            if self._run and self._run.known == session:
                self._drop_run()
            elif self._map == session and not self.problem:  # else whoever wants it is told that it is gone
                self._map = None

    def reset(self) -> None:
        """Start over: SLAM with an empty map, localization from nothing."""
        with self._lock:
            self._drop_run()
            self._placed = None
            self.odometry.clear()

    def close(self) -> None:
        """End what runs in the background."""
        with self._lock:
            if self._run:
                self._run.close()

    def place(self, pose: ArrayLike, covariance: ArrayLike, wanted: LiveNavigation) -> None:
        """The sensor is here, says someone: (3,) m, m, rad and (3, 3); between two runs, where the next one begins.

        Raises ConflictError if nothing is localized or the map cannot be moved, LocalizationError if that is no pose
        or no covariance.
        """
        if wanted.mode == "off" or self.problem:
            raise ConflictError(self.problem or NOT_LOCALIZED)
        if wanted.mode == "slam" and wanted.method == "scans":
            raise ConflictError(NOT_MOVED)
        checked = as_pose(pose, "pose")
        check_covariance(covariance, "The pose's covariance")
        with self._lock:
            if self._run is None:
                self._placed = checked, covariance
            else:
                self._run.navigator.place(checked, covariance)

    def deskewed(self, timed: TimedScan, settings: Settings) -> Scan:
        """The scan as if the sensor had stood, as far as its motion is known, with the odometry there is."""
        with self._lock:
            run = self._of(timed, settings)
            scan = self._with_odometry(timed.scan)
            return run.deskewed(timed.position.index, scan) if run else scan

    def step(
        self, timed: TimedScan, scan: Scan, features: Features, clusters: Clusters | None, method: str
    ) -> Localization | None:
        """Go on by a scan that `deskewed` gave; `method` is what found the landmarks in it."""
        with self._lock:
            run = self._run
            return run.step(timed.position.index, scan, features, clusters, method) if run else None

    def _with_odometry(self, scan: Scan) -> Scan:
        """A scan with the odometry that another program sent for its moment, unless the source has odometry itself."""
        if scan.odometry is not None or (pose := self.odometry.at(scan.stamp)) is None:
            return scan
        return replace(scan, odometry=pose)

    def _drop_run(self) -> None:
        if self._run:
            self._run.end()
        self._run = None

    def _of(self, timed: TimedScan, settings: Settings) -> Run | None:
        """The run that this scan belongs to; a new one where the old one does not lead to it."""
        run, wanted = self._run, settings.navigation
        if run and run.is_continued_by(timed, wanted):
            run.renew(settings.extraction)
            return run
        if run and wanted.mode == "localize":
            run.close()  # its map may be the one to localize in
        self._drop_run()
        self.problem = None
        is_over = self._is_map_used if wanted.mode == "slam" else wanted.mode == "off" and self._is_map_gone
        if is_over:
            self.choose_map(None)  # what is built now is meant next, or the newest
        if wanted.mode == "slam":
            self._run = building(self._store, timed, settings, self._tell_of_walls)
            if wanted.method == "scans":
                self._placed = None
        elif wanted.mode == "localize":
            self._run = self._localizing(timed, settings)
        else:
            self._store.use(None)
        self.runs += self._run is not None
        if self._run and self._placed:
            self._run.navigator.place(*self._placed)
            self._placed = None
        return self._run

    def _localizing(self, timed: TimedScan, settings: Settings) -> Run | None:
        self._store.settle()
        session = self._map if self._map is not None else self._store.newest()
        self._is_map_used = True
        self._store.use(session)
        try:
            return localizing(self._store, session, timed, settings)
        except UnknownSessionError:  # deleted meanwhile
            self._is_map_gone = True
            self.problem = GONE.format(session)
        except LandmarkMapError as error:
            self.problem = str(error)
        return None

    def _tell_of_walls(self) -> None:
        for listener in self.map_listeners:
            listener()
