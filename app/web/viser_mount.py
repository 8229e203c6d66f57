"""viser inside this process and on this port: no socket of its own, no way out, nothing to press.

viser 1.1.1 has no supported way to be mounted in an ASGI app. This file, and nothing else, rests on its
private parts, so the version is pinned and tests/app/test_viser_mount.py fails loudly when they change:

- `ViserServer` starts `websockets.asyncio.server.serve` in a thread of its own. While it does, that name
  stands for a server that keeps the connection handler and opens no socket.
- The handler needs `subprotocol`, `send`, `recv` and `close` of a connection: `_Connection` is one, around a
  Starlette WebSocket.
- What is drawn is told to waiting connections by an `asyncio.Event` that other threads set, which asyncio forbids:
  now and then drawing fails with "deque mutated during iteration". `_LoopEvent` takes its place.
- viser does not check what browsers send. Only where they look from is let in, which shuts the share tunnel,
  uploads into memory and changes of the shared panels.
"""

import asyncio
import contextlib
import io
import logging
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, TypeVar

import msgspec
import viser
import websockets.asyncio.server
from fastapi import APIRouter, FastAPI, WebSocket
from starlette.responses import HTMLResponse
from starlette.websockets import WebSocketDisconnect
from websockets.exceptions import ConnectionClosedOK

ADMITTED = ("ViewerCameraMessage",)
BRIDGE = '<script src="../static/viser_bridge.js"></script>'
POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob:; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self' data: blob:; worker-src blob:; base-uri 'none'; frame-ancestors 'self'"
)

Handler = Callable[["_Connection"], Coroutine[Any, Any, None]]
T = TypeVar("T")

logger = logging.getLogger(__name__)


class ViserMount:
    """A viser server without a socket, and the routes that stand in for it."""

    def __init__(self) -> None:
        with _quiet(), _no_socket() as handlers:
            self.server = viser.ViserServer(host="127.0.0.1", verbose=False)
        (self._handler,) = handlers
        self.server._websock_server.get_message_buffer().message_event = _LoopEvent(
            self.server.get_event_loop()
        )

    def install(self, app: FastAPI) -> None:
        """Serve the client at /viser/ and its WebSocket at /viser, where the client looks for it."""
        router = APIRouter(include_in_schema=False)
        page = _page()

        @router.get("/viser/")
        def client() -> HTMLResponse:
            return HTMLResponse(page, headers={"Content-Security-Policy": POLICY})

        router.add_api_websocket_route("/viser", self._serve)
        app.include_router(router)

    def close(self) -> None:
        with _quiet():
            self.server.stop()

    async def _serve(self, websocket: WebSocket) -> None:
        offered = (name for name in websocket.scope["subprotocols"] if name.startswith("viser-v"))
        protocol = next(offered, None)
        await websocket.accept(subprotocol=protocol)
        connection = _Connection(websocket, protocol)
        handling = asyncio.run_coroutine_threadsafe(self._handler(connection), self.server.get_event_loop())
        try:
            await asyncio.wrap_future(handling)
        except Exception as error:
            logger.warning("viser gave up a client: %r", error)
            with contextlib.suppress(RuntimeError, WebSocketDisconnect):  # it may be gone
                await websocket.close(1007)


class _LoopEvent(asyncio.Event):
    """Is set by its loop only: viser also asks the loop to set it, each time it sets it from another thread."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        super().__init__()
        self._own_loop = loop

    def set(self) -> None:
        try:
            here = asyncio.get_running_loop()
        except RuntimeError:  # none runs in this thread
            return
        if here is self._own_loop:
            super().set()


@contextlib.contextmanager
def _no_socket() -> Iterator[list[Handler]]:
    """While this lasts, a websockets server that is started binds nothing; its handlers are in the list."""
    handlers: list[Handler] = []

    @contextlib.asynccontextmanager
    async def unbound(handler: Handler, *_: object, **__: object) -> AsyncIterator[SimpleNamespace]:
        handlers.append(handler)
        yield SimpleNamespace(server=SimpleNamespace(sockets=()))

    serve = websockets.asyncio.server.serve
    websockets.asyncio.server.serve = unbound  # type: ignore[assignment,misc]
    try:
        yield handlers
    finally:
        websockets.asyncio.server.serve = serve  # type: ignore[misc]


class _Connection:
    """What viser's handler, on its own event loop, sees of a WebSocket that lives on the server's loop."""

    def __init__(self, websocket: WebSocket, subprotocol: str | None) -> None:
        self.subprotocol = subprotocol
        self._websocket = websocket
        self._loop = asyncio.get_running_loop()

    async def send(self, data: bytes) -> None:
        await self._there(self._websocket.send_bytes(data))

    async def recv(self) -> bytes:
        while True:
            message = await self._there(self._websocket.receive())
            data = message.get("bytes") or b""
            if message["type"] == "websocket.disconnect":
                raise ConnectionClosedOK(None, None)
            if _kind(data) in ADMITTED:
                return data

    async def close(self, code: int = 1000, reason: str = "") -> None:
        await self._there(self._websocket.close(code, reason))

    async def _there(self, call: Coroutine[Any, Any, T]) -> T:
        """Run the call on the loop of the WebSocket; a connection that is gone ends the handler in peace."""
        try:
            return await asyncio.wrap_future(asyncio.run_coroutine_threadsafe(call, self._loop))
        except (WebSocketDisconnect, RuntimeError) as error:
            raise ConnectionClosedOK(None, None) from error


def _kind(data: bytes) -> object:
    """The type of a message from the browser; None if it is not one."""
    try:
        message = msgspec.msgpack.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError):
        return None
    return message.get("type") if isinstance(message, dict) else None


def _page() -> str:
    """viser's client, which is one file, with our script ahead of its own."""
    html = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text("utf-8")
    if "<head>" not in html:
        raise RuntimeError(
            f"viser {viser.__version__}: the client's page has no <head> to put a script into."
        )
    return html.replace("<head>", f"<head>{BRIDGE}", 1)


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """viser announces addresses that nobody can reach here."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield
