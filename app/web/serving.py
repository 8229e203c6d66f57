"""The server process: one socket, its address printed, a clean end."""

import ctypes
import errno
import ipaddress
import secrets
import signal
import socket
import subprocess
import sys
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fastapi import FastAPI
    from uvicorn import Server

    from .state import ServerOptions

WS_MESSAGE = 1 << 20  # bytes of one message from a browser
GRACE = 2  # s that connections get to end
_M_ARENA_MAX = -8  # malloc.h of glibc
_MOST_ARENAS = 2


class AddressError(OSError):
    """The address cannot be listened on."""


def listen(host: str, port: int) -> socket.socket:
    """The listening socket. Raises AddressError that says what to do."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        listening = socket.create_server((host, port), family=family)
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            free = f"--http-port {port + 1} (make run PORT={port + 1})"
            raise AddressError(
                f"Port {port} of {host} is in use: choose another one, such as {free}."
            ) from error
        raise AddressError(f"Cannot listen on {host} port {port}: {error.strerror or error}.") from error
    # Connections inherit it; without it a body waits up to 40 ms until the client has acknowledged the head.
    listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listening


def secured(options: "ServerOptions", host: str) -> "ServerOptions":
    """The options; with a token and this machine's names if other machines can reach the host."""
    if is_loopback(host):
        return options
    own = (socket.gethostname(), f"{socket.gethostname()}.local")
    return replace(options, token=options.token or secrets.token_urlsafe(16), hosts=(*options.hosts, *own))


def run(options: "ServerOptions", listening: socket.socket, host: str, *, open_browser: bool) -> None:
    """Serve until interrupted. Raises RecordingError or TopicError if the recording cannot be played."""
    from .log import throttle_servers
    from .server import create_app
    from .transport import allow_many_files

    share_arenas()
    allow_many_files()
    throttle_servers()
    server = uvicorn_server(create_app(options))
    # The terminal was closed: the motor is to be stopped then, too.
    signal.signal(signal.SIGHUP, lambda *_: server.handle_exit(signal.SIGTERM, None))
    url = address(listening, host, options.token)
    print(f"lidarcore serves {url}", flush=True)
    print("Stop with Ctrl-C.", flush=True)
    if open_browser:
        webbrowser.open(url)
    with compiled_ahead(), suppress(KeyboardInterrupt):
        server.run(sockets=[listening])


def share_arenas() -> None:
    """Have all threads share few of glibc's heaps: each keeps what its threads freed, and requests come in many."""
    with suppress(AttributeError, OSError, TypeError):  # another C library, which has none
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, _MOST_ARENAS)


@contextmanager
def compiled_ahead() -> Iterator[None]:
    """Compile the kernels of maps that the cache lacks in a process of its own: the first map would wait a minute.

    What is not finished in the end is left for next time. It says nothing: without it everything works, later.
    """
    from lidarcore.mapping import precompile

    if not precompile.is_missing():
        yield
        return
    # A session of its own: Ctrl-C ends the server, which then ends this process without a traceback in between.
    process = subprocess.Popen(
        [sys.executable, "-m", precompile.__name__],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield
    finally:
        process.kill()  # a kernel that is half written is written to a name of its own first
        process.wait()


def uvicorn_server(app: "FastAPI") -> "Server":
    """uvicorn around the app, without compression: it costs more than it saves, and delays frames."""
    from uvicorn import Config, Server

    from .transport import PatientHttp, PromptWebSockets

    config = Config(
        app,
        log_level="warning",
        access_log=False,
        server_header=False,
        http=PatientHttp,
        ws=PromptWebSockets,
        ws_per_message_deflate=False,
        ws_max_size=WS_MESSAGE,
        timeout_graceful_shutdown=GRACE,
    )
    return Server(config)


def address(listening: socket.socket, host: str, token: str | None) -> str:
    """What to open in a browser."""
    everywhere = host in ("0.0.0.0", "::")
    name = socket.gethostname() if everywhere else f"[{host}]" if ":" in host else host
    return f"http://{name}:{listening.getsockname()[1]}/" + (f"?token={token}" if token else "")


def is_loopback(host: str) -> bool:
    """Only programs on this machine can reach it."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
