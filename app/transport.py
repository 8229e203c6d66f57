"""How messages leave: uvicorn's WebSocket protocol without a buffer of its own."""

from asyncio.transports import BaseTransport, WriteTransport
from typing import cast

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol


class PromptWebSockets(WebSocketsSansIOProtocol):
    """Holds nothing back: sending waits until the kernel has room, so that a newer frame can take its place."""

    def connection_made(self, transport: BaseTransport) -> None:
        cast(WriteTransport, transport).set_write_buffer_limits(high=0)
        super().connection_made(transport)
