"""How a run begins: SLAM with an empty map, or localization in one that is kept."""

from collections.abc import Callable, Hashable

from lidarcore.errors import LandmarkMapError
from lidarcore.localization import Navigator
from lidarcore.mapping import MapPicture, WholeScans
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.walls import WallTable

from ..sources.timed_scan import TimedScan
from .map_store import MapStore
from .settings import Settings
from .slam_run import Run
from .trails import Trails

NO_MAP = "There is no map to localize in: build one by SLAM, or load one."


def building(store: MapStore, timed: TimedScan, settings: Settings, tell: Callable[[], None]) -> Run:
    """SLAM begins with this scan; `tell` is called, from another thread, when whole scans have made other walls."""
    wanted = settings.navigation
    replay = (timed.name, wanted) if timed.position.kind == "recording" else None
    if wanted.method == "scans":
        navigator = WholeScans(settings.extraction, lambda: _begin_walls(store, timed.name, replay, tell))
        return Run(timed.source, wanted, navigator, None, None, Trails(own_frame=True))
    written = store.begin(timed.name, replay=replay)
    return Run(timed.source, wanted, Navigator(wanted), written, None, Trails(own_frame=True))


def localizing(store: MapStore, session: int | None, timed: TimedScan, settings: Settings) -> Run:
    """Localization begins in the map of a session. Raises LandmarkMapError if there is none, or it holds nothing."""
    if session is None:
        raise LandmarkMapError(NO_MAP)
    navigator = _navigator_in(store, session, settings)
    # The truth of a recording has a frame of its own, whatever map is used.
    own_frame = store.is_built(session) or timed.position.kind == "recording"
    if navigator is None:
        raise LandmarkMapError(NO_MAP)
    return Run(timed.source, settings.navigation, navigator, None, session, Trails(own_frame))


def _begin_walls(
    store: MapStore, source: str, replay: Hashable, tell: Callable[[], None]
) -> Callable[[OccupancyGrid, WallTable], None]:
    """Where grid and walls go whenever they are other ones."""
    run = store.begin_walls(source, replay=replay)

    def keep(grid: OccupancyGrid, walls: WallTable) -> None:
        run.put(grid, walls)
        tell()

    return keep


def _navigator_in(store: MapStore, session: int, settings: Settings) -> Navigator | WholeScans | None:
    """What localizes in the map of a session: whole scans if it has a grid, else landmarks, if there are any."""
    if (grid := store.grid(session)) is not None:
        walls = store.walls(session)
        return WholeScans(settings.extraction, known=MapPicture(grid, walls if len(walls) else None))
    known = store.landmarks(session)
    return Navigator(settings.navigation, known) if known else None
