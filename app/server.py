"""The app: REST, WebSocket, page and scene on one port."""

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from tempfile import mkdtemp

from fastapi import APIRouter, FastAPI
from fastapi.staticfiles import StaticFiles
from starlette.responses import FileResponse

from app import problems
from app.api import (
    calibration,
    clusters,
    docs,
    frame,
    landmarks,
    localization,
    map,
    meta,
    recorder,
    recordings,
    repeatability,
    selection,
    sensor,
    sessions,
    settings,
    source,
    studies,
)
from app.calibration import LiveCalibration
from app.landmark_store import LandmarkStore
from app.library import MAX_BYTES, Library
from app.live import DeviceOptions, Taps, connected_or_emulated
from app.metrics import Metrics, metrics_router
from app.navigation import Navigation
from app.profiles import Profiles
from app.recorder import AsyncRecorder
from app.repeatability import LiveRepeatability
from app.runtime import Runtime, UnknownCornerError
from app.scene import Scene
from app.security import Guard
from app.settings import Settings
from app.sources import RecordingSource, Source
from app.stream import Hub
from app.studies import Studies
from app.viser_mount import ViserMount
from lidarcore import Scan, extract
from lidarcore.errors import LandmarkMapError

API = "/api/v1"
MAP_FILE = "landmarks.db"
STUDIES = "studies"
PROFILES = "profiles"
ROOMS = (
    frame, clusters, localization, landmarks, map, sessions, repeatability, calibration, studies, settings, source,
    sensor, recordings, recorder, selection, meta,
)  # fmt: skip
STATIC = Path(str(resources.files("app"))).parent / "static"


@dataclass(frozen=True)
class ServerOptions:
    """What is decided when the server starts."""

    recordings: Path = Path("recordings")
    recording: Path | None = None
    topic: str | None = None
    map: str | None = None
    device: DeviceOptions = field(default_factory=DeviceOptions)
    say: Callable[[str], None] = lambda sentence: None
    settings: Settings = field(default_factory=Settings)
    max_bytes: int = MAX_BYTES
    hosts: tuple[str, ...] = ()
    token: str | None = None


def create_app(options: ServerOptions) -> FastAPI:
    """The whole server as an ASGI app. Raises RecordingError, TopicError or DeviceError if it has nothing to play."""
    recording, measured = AsyncRecorder(), Metrics()
    taps = Taps(scan=lambda scan: _record(recording, runtime, scan), bytes=recording.tap)
    first = _first_source(options, taps)
    mount = ViserMount()
    scene = Scene(
        mount.server,
        lambda corner: _try_to_select(runtime, corner),
        lambda landmark: runtime.select_landmark(landmark),
    )
    store = _landmark_store(options)
    runtime = Runtime(first, options.settings, Navigation(store), scene.draw)
    hub = Hub(runtime, recording, store, measured.sent)
    measured.watch(runtime, hub, recording)
    standing = LiveRepeatability()
    runtime.frame_listeners.append(standing.tell)
    calibrating = LiveCalibration(runtime.player, lambda: runtime.ready)
    runtime.frame_listeners.append(calibrating.tell)
    runtime.change_listeners.append(calibrating.look)
    laboratory = Studies(options.recordings.parent / STUDIES)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        hub.open()
        runtime.start()
        yield
        hub.close()
        runtime.close()
        laboratory.close()
        standing.close()
        recording.stop()
        store.close()
        mount.close()

    app = FastAPI(
        title="lidarcore",
        version=meta.version_of("lidarcore"),
        description="2D lidar scans to walls, corners and their covariances. Metres, radians, seconds.",
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        responses=problems.documented(422),
    )
    app.state.runtime, app.state.hub, app.state.viser = runtime, hub, mount.server
    app.state.studies = laboratory
    app.state.library = Library(options.recordings, options.max_bytes, options.recording)
    app.state.recorder, app.state.taps, app.state.landmarks = recording, taps, store
    app.state.repeatability = standing
    app.state.calibration = calibrating
    app.state.profiles = Profiles(options.recordings.parent / PROFILES)
    problems.install(app)
    problems.document(app)
    api = APIRouter(prefix=API)
    for module in ROOMS:
        api.include_router(module.router)
    app.include_router(api)
    app.include_router(docs.router)
    app.include_router(metrics_router(measured))
    mount.install(app)
    _add_page(app)
    app.add_middleware(
        Guard, hosts=options.hosts, token=options.token, uploads=(f"{API}/recordings/", f"{API}/map")
    )
    return app


def _landmark_store(options: ServerOptions) -> LandmarkStore:
    """The file of maps given, else one beside the folder of recordings, or one that ends with the server."""
    if options.map is not None:
        return LandmarkStore(options.map)
    try:
        return LandmarkStore(options.recordings.parent / MAP_FILE)
    except LandmarkMapError as error:
        options.say(f"{error} Maps are lost when the server ends; give a file for --map to keep them.")
        return LandmarkStore(Path(mkdtemp(prefix="lidarcore-")) / MAP_FILE)


def _first_source(options: ServerOptions, taps: Taps) -> Source:
    """The recording given; else the sensor asked for or connected, else an emulated one, and says which."""
    if options.recording is not None:
        return RecordingSource(options.recording, options.topic)
    source, sentences = connected_or_emulated(options.device, taps)
    for sentence in sentences:
        options.say(sentence)
    return source


def _record(recording: AsyncRecorder, runtime: Runtime, scan: Scan) -> None:
    """Every scan of a live source is recorded, shown or not, with what the main method finds in it."""
    if recording.running:
        recording.put(scan, extract(scan, runtime.settings.extraction))


def _try_to_select(runtime: Runtime, corner: int) -> None:
    """A click may come after its corner has gone."""
    with suppress(UnknownCornerError):
        runtime.select_corner(corner)


def _add_page(app: FastAPI) -> None:
    @app.get("/", include_in_schema=False)
    def page() -> FileResponse:
        return FileResponse(STATIC / "index.html")

    @app.get("/studies", include_in_schema=False)
    def studies_page() -> FileResponse:
        return FileResponse(STATIC / "studies.html")

    @app.get("/guide", include_in_schema=False)
    def guide() -> FileResponse:
        return FileResponse(STATIC / "guide.html")

    app.mount("/static", StaticFiles(directory=STATIC), name="static")
