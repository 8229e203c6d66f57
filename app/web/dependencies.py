"""What the routes need of the server that they run in."""

from typing import Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection

from ..pipeline.frame import Frame
from .state import State


async def _state(connection: HTTPConnection) -> State:
    """On the event loop, since nothing waits."""
    state: State = connection.app.state.server
    return state


Server = Annotated[State, Depends(_state)]


async def _frame(server: Server) -> Frame:
    return server.runtime.newest()


CurrentFrame = Annotated[Frame, Depends(_frame)]
