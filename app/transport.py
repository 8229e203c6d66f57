"""How messages leave: uvicorn's WebSocket protocol without a buffer of its own, and with a small one of the kernel."""

import socket
from asyncio.transports import BaseTransport, WriteTransport
from typing import cast

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

SEND_BUFFER = 1 << 15  # bytes: what the kernel may hold back of a slow client, so that nothing in it gets old


class PromptWebSockets(WebSocketsSansIOProtocol):
    """Holds nothing back: sending waits until the kernel has room, so that a newer frame can take its place."""

    def connection_made(self, transport: BaseTransport) -> None:
        cast(WriteTransport, transport).set_write_buffer_limits(high=0)
        # Not of plain HTTP: a large answer would wait again and again for a client that acknowledges late.
        transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        super().connection_made(transport)
