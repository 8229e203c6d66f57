"""How bytes come and go below HTTP: requests that never end are dropped, and frames for slow clients do not pile up."""

import asyncio
import resource
import socket
from asyncio.transports import BaseTransport, WriteTransport
from typing import Any, ClassVar, cast

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

SEND_BUFFER = 1 << 15  # bytes: what the kernel may hold back of a slow client, so that nothing in it gets old
# s from the connection, or from the answer before, until the head of a request is complete
HEAD_WITHIN = 10.0
BODY_WITHIN = 30.0  # s between two pieces of a body
MOST_UNFINISHED = 256  # requests that are still arriving at once; one more, and the oldest is dropped
MOST_FILES = 16384  # handles of files and connections that this process asks the system for


class PatientHttp(H11Protocol):
    """Waits for a request as long as an honest client may take, and for no more than MOST_UNFINISHED at once."""

    _unfinished: ClassVar[dict["PatientHttp", asyncio.TimerHandle]] = {}  # in the order in which they began

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._expect(HEAD_WITHIN)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.transport.get_protocol() is not self:  # it has become a WebSocket
            self._expect_nothing()
        elif self.conn.their_state is h11.SEND_BODY:
            self._expect(BODY_WITHIN)
        elif self.conn.their_state is not h11.IDLE:
            self._expect_nothing()

    def on_response_complete(self) -> None:
        super().on_response_complete()
        if self.conn.their_state is h11.IDLE and not self.transport.is_closing():
            self._expect(HEAD_WITHIN)

    def connection_lost(self, exc: Exception | None) -> None:
        self._expect_nothing()
        super().connection_lost(exc)

    def _expect(self, seconds: float) -> None:
        """Drop the connection unless it goes on within this time."""
        self._expect_nothing()
        self._unfinished[self] = self.loop.call_later(seconds, self._give_up)
        if len(self._unfinished) > MOST_UNFINISHED:
            next(iter(self._unfinished))._give_up()

    def _expect_nothing(self) -> None:
        if timer := self._unfinished.pop(self, None):
            timer.cancel()

    def _give_up(self) -> None:
        if self.flow.read_paused:  # what was sent is not taken yet: it is not the client who is slow
            self._expect(BODY_WITHIN)
        else:
            self._expect_nothing()
            self.transport.abort()


class PromptWebSockets(WebSocketsSansIOProtocol):
    """Holds nothing back: sending waits until the kernel has room, so that a newer frame can take its place."""

    def connection_made(self, transport: BaseTransport) -> None:
        cast(WriteTransport, transport).set_write_buffer_limits(high=0)
        # Not of plain HTTP: a large answer would wait again and again for a client that acknowledges late.
        transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        super().connection_made(transport)

    async def send(self, message: Any) -> None:
        """uvicorn does not take a refusal for an answer to the handshake, and would log an error for each."""
        await super().send(message)
        if message["type"] == "websocket.http.response.body" and not message.get("more_body"):
            self.handshake_complete = True


def allow_many_files() -> None:
    """Ask for up to MOST_FILES file handles: systems often give 1,024, and each connection takes one."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = MOST_FILES if hard == resource.RLIM_INFINITY else min(hard, MOST_FILES)
    if soft != resource.RLIM_INFINITY and soft < most:
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
