"""The app: REST, WebSocket, page and scene on one port."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from fastapi import APIRouter, Depends, FastAPI
from fastapi.staticfiles import StaticFiles
from starlette.responses import FileResponse, HTMLResponse, Response
from starlette.types import Receive, Scope, Send

from ..scene.palette import stylesheet
from . import openapi, problems
from .metrics import metrics_router
from .requests.queries import check_query
from .routes import (
    calibration,
    frame,
    grid,
    landmarks,
    localization,
    map,
    map_making,
    measure,
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
    wall_history,
    walls,
)
from .security import Guard
from .state import ServerOptions, State

API = "/api/v1"
ROUTES = (
    frame, measure, localization, walls, wall_history, grid, landmarks, map_making, map, sessions, repeatability,
    calibration, studies, settings, source, sensor, recordings, recorder, selection, meta,
)  # fmt: skip
PAGES = {"/": "index.html", "/studies": "studies.html", "/guide": "guide.html", "/docs": "docs.html"}
_APP = Path(__file__).parents[1]
STATIC = next(
    folder for folder in (_APP / "static", _APP.parent / "static") if folder.is_dir()
)  # wheel, source tree
# In the wheel, in the source tree.
DOCUMENTATION = (_APP / "documentation", _APP.parent / "docs" / "_build" / "html")
MISSING = """<!doctype html><html lang="en"><meta charset="utf-8"><title>lidarcore: documentation</title>
<meta name="viewport" content="width=device-width"><meta name="color-scheme" content="light dark">
<style>body { max-width: 38rem; margin: 3rem auto; padding: 0 1rem; font: 16px/1.5 system-ui, sans-serif; }</style>
<h1>The documentation has not been built</h1>
<p>In the source tree, run <code>make docs</code> and reload this page. It needs no restart.</p>
<p>The same pages can be read as text in the folder <code>docs</code>. The <a href="../guide">guide</a> to the ellipses
and the <a href="../docs">reference of the REST API</a> are always there. <a href="../">Back to the dashboard</a></p>
"""
# What the OpenAPI document says of the whole; /docs shows it, and tries it out, by Swagger UI without a network.
DESCRIPTION = """2D lidar scans to walls, corners and their covariances. Metres, radians, seconds.
Errors are problem details (RFC 9457).

`WebSocket /api/v1/stream` (`?points=true` adds the measured points) sends JSON objects with a member `type`:
`state` at first and after every change, with settings, source, selection, localization, recorder, ready,
sessions_revision, another number whenever `GET /api/v1/sessions` has another list, and making_revision, another one
whenever a map of a recording in `GET /api/v1/map/making` was asked for, has begun or ended;
`frame` with the members of `GET /api/v1/frame`; `landmarks` with what has changed in the map of a session; `walls`,
about once a second, with all walls of the map of whole scans, as in `GET /api/v1/walls`, and their `corners`. A slow
client gets fewer frames, never old ones. A client may send `{"type": "odometry", "stamp": ..., "x": ..., "y": ...,
"heading": ...}`, as `POST /api/v1/odometry` takes it; what is wrong with a message comes back as `error`.
"""


def create_app(options: ServerOptions) -> FastAPI:
    """The whole server as an ASGI app. Raises RecordingError, TopicError or DeviceError if it has nothing to play."""
    state = State(options)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        state.open()
        yield
        state.close()

    app = FastAPI(
        title="lidarcore",
        version=meta.version_of("lidarcore"),
        description=DESCRIPTION,
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        responses=problems.documented(422),
    )
    app.state.server = state
    problems.install(app)
    openapi.document(app)
    api = APIRouter(prefix=API, dependencies=[Depends(check_query)])
    for module in ROUTES:
        api.include_router(module.router)
    app.include_router(api)
    app.include_router(metrics_router(state.metrics))
    state.viser.install(app)
    for path, file in PAGES.items():
        _add_page(app, path, file)
    _add_palette(app)
    app.mount("/documentation", Documentation(), name="documentation")
    app.mount("/static", StaticFiles(directory=STATIC), name="static")
    uploads = (f"{API}/recordings/", f"{API}/map")
    app.add_middleware(Guard, hosts=options.hosts, token=options.token, uploads=uploads)
    return app


def _add_page(app: FastAPI, path: str, file: str) -> None:
    @app.get(path, include_in_schema=False)
    def page() -> FileResponse:
        return FileResponse(STATIC / file)


def _add_palette(app: FastAPI) -> None:
    @app.get("/palette.css", include_in_schema=False)
    def palette() -> Response:
        return Response(stylesheet(), media_type="text/css")


class Documentation:
    """An ASGI app: the built documentation, or a page that says how to build it, which needs no restart then."""

    def __init__(self, folders: tuple[Path, ...] = DOCUMENTATION) -> None:
        """The first folder that holds an index.html is served."""
        self._folders = folders

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        folder = next((folder for folder in self._folders if (folder / "index.html").is_file()), None)
        app = HTMLResponse(MISSING, 404) if folder is None else StaticFiles(directory=folder, html=True)
        await app(scope, receive, send)
