"""Real servers on ports of their own, real clients, and a room whose corners are known."""

import asyncio
import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import urlsplit

import httpx
import numpy as np
import viser
from lidarcore_app.pipeline.runtime import Runtime
from lidarcore_app.web.server import ServerOptions, create_app
from lidarcore_app.web.serving import listen, uvicorn_server
from lidarcore_app.web.viser_mount import ViserMount
from waiting import PATIENCE
from waiting import wait_until as wait_until
from websockets.sync.client import ClientConnection, connect

ROOT = Path(__file__).parents[2]
CORNERS = np.array([[3.5, 2.2], [-2.5, 2.2], [-2.5, -1.8], [3.5, -1.8]])  # m, in the sensor frame
SINCE = 1e9  # s: stamp of the first scan of what a server plays until it is told what to play
ROBOT = {"kind": "simulation", "settings": {"world": "two rooms", "seed": 3}}
Json = dict[str, Any]


class Server:
    """A server in a thread: its address, a client, and its inside for what cannot be seen from outside."""

    def __init__(self, folder: Path, **options: Any) -> None:
        self._maps = TemporaryDirectory()
        maps = {"map": str(Path(self._maps.name) / "landmarks.db")}
        app = self.app = create_app(ServerOptions(recordings=folder, **maps | options))
        self.runtime: Runtime = app.state.server.runtime
        self.mount: ViserMount = app.state.server.viser
        self.viser: viser.ViserServer = self.mount.server
        self.folder = folder
        self._listening = listen("127.0.0.1", 0)
        self.port: int = self._listening.getsockname()[1]
        self.url = f"http://127.0.0.1:{self.port}"
        self.http = httpx.Client(base_url=f"{self.url}/api/v1", timeout=PATIENCE)
        self._server = uvicorn_server(app)
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self._server.serve(sockets=[self._listening])), daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        self.http.close()
        self._server.should_exit = True
        self._thread.join(timeout=PATIENCE)
        assert not self._thread.is_alive(), "the server did not stop"
        self._maps.cleanup()

    def get(self, path: str, **params: Any) -> Any:
        return self.http.get(path, params=params).raise_for_status().json()

    def change(self, method: str, path: str, body: object) -> Any:
        return self.http.request(method, path, json=body).raise_for_status().json()

    @contextmanager
    def stream(self, **options: Any) -> Iterator["Stream"]:
        with connect(f"ws://127.0.0.1:{self.port}/api/v1/stream?points=true", max_size=None, **options) as ws:
            yield Stream(ws)

    def next_frame(self) -> Json:
        """A frame of a scan that is taken after this call."""
        with self.stream() as stream:
            newest = stream.frame()
            return stream.frame(lambda frame: frame["sequence"] > newest["sequence"])

    def play(self, path: Path, **options: Any) -> Json:
        """Play that file of the folder, and return a frame of it: never one of the same file played before."""
        self.change("PUT", "/source", {"kind": "recording", "name": path.name, **options})
        opened = self.runtime.player._opened
        wait_until(lambda: self.runtime.frame and self.runtime.frame.timed.source == opened, f"{path} plays")
        with self.stream() as stream:
            return stream.frame()

    def recordings(self) -> list[Json]:
        """The entries of what is in the folder: without what comes along, or was given at the start."""
        names = {path.name for path in self.folder.iterdir()}
        return [entry for entry in self.get("/recordings")["recordings"] if entry["name"] in names]


class Stream:
    """The messages of the WebSocket, waited for."""

    def __init__(self, websocket: ClientConnection) -> None:
        self.websocket = websocket

    def message(self) -> Json:
        return strict_json(self.websocket.recv(timeout=PATIENCE))

    def until(self, kind: str, holds: Callable[[Json], object]) -> Json:
        end = time.monotonic() + 2 * PATIENCE
        while time.monotonic() < end:
            message = self.message()
            if message["type"] == kind and holds(message):
                return message
        raise AssertionError(f"no {kind} of which that holds")

    def frame(self, holds: Callable[[Json], object] = bool) -> Json:
        return self.until("frame", holds)

    def state(self, holds: Callable[[Json], object] = bool) -> Json:
        return self.until("state", holds)


def chosen(frame: Json) -> bool:
    """The scan is not of the recording that a server plays until it is told what to play."""
    return not SINCE <= frame["stamp"] < SINCE + 100


def strict_json(text: str | bytes) -> Any:
    """JSON without the NaN and Infinity that Python would let pass."""

    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    return json.loads(text, parse_constant=refuse)


def room_ranges(bearings: np.ndarray) -> np.ndarray:
    """Ranges to the walls of the rectangle with the given CORNERS, by plain geometry."""
    (x_high, y_high), (x_low, y_low) = CORNERS[0], CORNERS[2]
    c, s = np.cos(bearings), np.sin(bearings)
    with np.errstate(divide="ignore"):
        return np.minimum(np.maximum(x_high / c, x_low / c), np.maximum(y_high / s, y_low / s))


def write_room(
    path: Path, scans: int = 30, period: float = 0.1, noise: float = 0.005, since: float = 100.0
) -> Path:
    """A recording of a sensor that stands still in that room."""
    rng = np.random.default_rng(1)
    bearings = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    ranges = room_ranges(bearings) + rng.normal(0, noise, (scans, len(bearings)))
    with path.open("wb") as file:
        np.savez(file, ranges=ranges, bearings=bearings, stamps=since + period * np.arange(scans))
    return path


def assert_problem(response: httpx.Response, status: int) -> Json:
    """The answer is problem details (RFC 9457) of that status; returned for what else they should say."""
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    problem = strict_json(response.text)
    assert problem["status"] == status
    assert problem["title"]
    assert problem["detail"]
    assert problem["instance"] == urlsplit(str(response.request.url)).path
    return problem
