"""Who may talk to the server: checked for every request and WebSocket before anything else sees it.

Browsers are the danger, not programs: any web page may send requests to a server on the same machine. It
cannot forge Origin and Host, though, so whatever changes something, and every WebSocket, must come from this
server's own pages; and Host must be an address or a name known to be ours, since a page makes itself look
like one of ours by rebinding its own name to our address.
"""

import ipaddress
import secrets
from collections.abc import Collection
from contextlib import suppress
from urllib.parse import urlsplit

from starlette.datastructures import URL, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from .problems import ProblemError

COOKIE = "lidarcore_token"
MAX_BODY = 1 << 20  # bytes of a request that is not an upload
SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self'; connect-src 'self'; frame-src 'self'; manifest-src 'self'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'self'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}


class Guard:
    """ASGI middleware: host, origin, token, size of the body, and the headers of every answer."""

    def __init__(
        self, app: ASGIApp, hosts: Collection[str], token: str | None, uploads: tuple[str, ...]
    ) -> None:
        """Names in `hosts` are ours besides localhost; PUT and POST to `uploads` bound their bodies themselves."""
        self._app, self._token, self._uploads = app, token, uploads
        self._hosts = {"localhost", *(host.lower() for host in hosts)}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        answer = self._answer(HTTPConnection(scope))
        await (answer or self._app)(
            scope, receive if self._is_upload(scope) else _bounded(receive), _secured(send)
        )

    def _answer(self, connection: HTTPConnection) -> Response | None:
        """What to say instead of passing the request on; None if it may pass."""
        try:
            self._check_host(connection)
            self._check_origin(connection)
            answer = self._sign_in(connection)
            if answer is None:
                self._check_token(connection)
            return answer
        except ProblemError as problem:
            return problem.response(connection.url.path)

    def _check_host(self, connection: HTTPConnection) -> None:
        host = connection.headers.get("host", "")
        name = _hostname(host)
        if name not in self._hosts and not _is_address(name):
            raise ProblemError(
                421, f"This server is not {host!r}: use its address, or start it with --allow-host."
            )

    def _check_origin(self, connection: HTTPConnection) -> None:
        origin = connection.headers.get("origin")
        if origin is None or connection.scope.get("method") in SAFE_METHODS:
            return
        if _netloc(origin) != connection.headers["host"]:
            raise ProblemError(403, f"Pages from {origin!r} may neither change nor watch anything here.")

    def _sign_in(self, connection: HTTPConnection) -> Response | None:
        """The right token in the address becomes a cookie, and leaves the address."""
        url = connection.url
        given = connection.query_params.get("token")
        if given is None or connection.scope.get("method") != "GET" or not self._matches(given):
            return None
        response = RedirectResponse(
            str(URL(url.path).replace(query=url.remove_query_params("token").query)), 303
        )
        response.set_cookie(COOKIE, given, httponly=True, samesite="strict", secure=url.scheme == "https")
        return response

    def _check_token(self, connection: HTTPConnection) -> None:
        if self._token is None:
            return
        scheme, _, credentials = connection.headers.get("authorization", "").partition(" ")
        given = credentials if scheme.lower() == "bearer" else connection.cookies.get(COOKIE, "")
        if not self._matches(given):
            hint = "open the address printed at the start, or send the token as 'Bearer' authorization"
            raise ProblemError(401, f"A token is needed: {hint}.", {"WWW-Authenticate": "Bearer"})

    def _matches(self, given: str) -> bool:
        return self._token is not None and secrets.compare_digest(given.encode(), self._token.encode())

    def _is_upload(self, scope: Scope) -> bool:
        """Whether the path is one of those for uploads, or below one that ends with a slash."""
        path: str = scope["path"]
        is_below = any(path.startswith(known) for known in self._uploads if known.endswith("/"))
        return scope.get("method") in ("PUT", "POST") and (path in self._uploads or is_below)


def _hostname(host: str) -> str:
    with suppress(ValueError):
        return urlsplit(f"//{host}").hostname or ""
    return ""


def _netloc(origin: str) -> str:
    with suppress(ValueError):
        return urlsplit(origin).netloc
    return ""


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _bounded(receive: Receive) -> Receive:
    """Refuse a body larger than MAX_BODY, whatever its Content-Length says."""
    total = 0

    async def bounded() -> Message:
        nonlocal total
        message = await receive()
        total += len(message.get("body", b"")) if message["type"] == "http.request" else 0
        if total > MAX_BODY:
            raise HTTPException(413, f"The body is larger than {MAX_BODY} bytes.")
        return message

    return bounded


def _secured(send: Send) -> Send:
    async def secured(message: Message) -> None:
        if message["type"].endswith("http.response.start"):
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return secured
