"""Where the sensor is, from scan to scan: the navigator of the current run, what feeds it and what it leaves behind."""

import threading
from dataclasses import replace

from numpy.typing import ArrayLike

from app.landmark_store import LandmarkStore
from app.odometry_feed import OdometryFeed
from app.run import Run, Where
from app.settings import Settings
from app.taken import Taken
from app.trails import NO_PATHS, Paths, Row, Trails
from lidarcore import Features, Scan
from lidarcore.clusters import Clusters
from lidarcore.errors import LandmarkMapError, LocalizationError
from lidarcore.localization import NavigationSettings, Navigator
from lidarcore.localization.estimate import as_pose
from lidarcore.localization.points import check_covariance
from lidarcore.scan import Array

NO_MAP = "There is no map to localize in: build one by SLAM, or load one."


class NotNavigatingError(LocalizationError):
    """Nothing estimates a pose at the moment."""


class Navigation:
    """Feeds the navigator with scans from the worker's thread; the rest may be called from any thread."""

    def __init__(self, store: LandmarkStore) -> None:
        self.odometry = OdometryFeed()
        self.problem: str | None = None
        self._store = store
        self._map: int | None = None
        self._run: Run | None = None
        self._placed: tuple[Array, ArrayLike] | None = None
        self._lock = threading.RLock()

    @property
    def session(self) -> int | None:
        """The session of the map that is built, or localized in."""
        run = self._run
        return run.session if run else None

    @property
    def map(self) -> int | None:
        """The session chosen to localize in; None for the newest with landmarks."""
        return self._map

    @property
    def trajectory(self) -> list[Row]:
        """All poses of this run that are kept."""
        with self._lock:
            return list(self._run.trails.trajectory) if self._run else []

    @property
    def paths(self) -> Paths:
        """Where the sensor has been in this run."""
        run = self._run
        return run.trails.paths() if run else NO_PATHS

    def choose_map(self, session: int | None) -> None:
        """Localize in the landmarks of that session. Raises UnknownSessionError."""
        if session is not None:
            self._store.landmarks(session)
        with self._lock:
            self._map = session
            if self._run and self._run.known is not None:
                self._run = None

    def reset(self) -> None:
        """Begin again: SLAM with an empty map, localization from nothing."""
        with self._lock:
            self._run = self._placed = None
            self.odometry.clear()

    def place(self, pose: ArrayLike, covariance: ArrayLike, mode: str) -> None:
        """The sensor is here, says someone: (3,) m, m, rad and (3, 3). Raises LocalizationError.

        Between two runs it is where the next one begins.
        """
        if mode == "off" or self.problem:
            raise NotNavigatingError(
                self.problem or "Nothing is localized: set navigation.mode to slam or localize."
            )
        checked = as_pose(pose, "pose")
        check_covariance(covariance, "The pose's covariance")
        with self._lock:
            if self._run is None:
                self._placed = checked, covariance
            else:
                self._run.navigator.place(checked, covariance)

    def deskewed(self, taken: Taken, settings: Settings) -> Scan:
        """The scan as if the sensor had stood, as far as its motion is known, with the odometry there is."""
        with self._lock:
            run = self._of(taken, settings.navigation)
            scan = self._with_odometry(taken.scan)
            return run.deskewed(taken.position["index"], scan) if run else scan

    def step(
        self, taken: Taken, scan: Scan, features: Features, clusters: Clusters | None, method: str
    ) -> Where | None:
        """Go on by a scan that `deskewed` gave; `method` is what found the landmarks in it."""
        with self._lock:
            run = self._run
            return run.step(taken.position["index"], scan, features, clusters, method) if run else None

    def _with_odometry(self, scan: Scan) -> Scan:
        """With what another program says of the moment, unless the source has odometry itself."""
        if scan.odometry is not None or (pose := self.odometry.at(scan.stamp)) is None:
            return scan
        return replace(scan, odometry=pose)

    def _of(self, taken: Taken, wanted: NavigationSettings) -> Run | None:
        """The run that this scan belongs to; a new one where the old one does not lead to it."""
        run = self._run
        if run and run.leads_to(taken, wanted):
            return run
        self._run = self.problem = None
        if wanted.mode == "slam":
            written = self._store.begin(taken.name)
            self._run = Run(taken.source, wanted, Navigator(wanted), written, None, Trails(own_frame=True))
        elif wanted.mode == "localize":
            self._run = self._localizing(taken, wanted)
        else:
            self._store.use(None)
        if self._run and self._placed:
            self._run.navigator.place(*self._placed)
            self._placed = None
        return self._run

    def _localizing(self, taken: Taken, wanted: NavigationSettings) -> Run | None:
        session = self._map if self._map is not None else self._store.newest()
        self._store.use(session)
        try:
            known = self._store.landmarks(session) if session is not None else ()
            if session is None or not known:
                self.problem = NO_MAP
                return None
            own_frame = self._store.atlas.session(session).mode == "slam"
        except LandmarkMapError as error:  # deleted meanwhile, or the file cannot be read
            self.problem = str(error)
            return None
        return Run(taken.source, wanted, Navigator(wanted, known), None, session, Trails(own_frame))
