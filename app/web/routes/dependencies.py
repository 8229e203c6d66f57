"""What the routes need of the server that they run in."""

from typing import Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection

from ...errors import NotFoundError
from ...pipeline.frame import Frame
from ..state import State


async def _state(connection: HTTPConnection) -> State:
    """On the event loop, since nothing waits."""
    state: State = connection.app.state.server
    return state


Server = Annotated[State, Depends(_state)]


async def _frame(server: Server) -> Frame:
    if server.runtime.frame is None:
        why = "no scan has been processed" if server.runtime.ready else "the kernels are still being compiled"
        raise NotFoundError(f"There is no frame yet: {why}.")
    return server.runtime.frame


CurrentFrame = Annotated[Frame, Depends(_frame)]
