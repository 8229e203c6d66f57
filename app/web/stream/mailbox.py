"""Newest wins: a client of the stream has room for one state, the walls and one frame, and never gets an old one."""

import asyncio
from collections.abc import Callable

from pydantic_core import to_json

from lidarcore.landmarks import Landmark

from ...jobs.maps.session_writer import MapChange
from ...pipeline.frame import Frame
from ..answers.serializers import frame_text


class MapChanges:
    """Changes of the map still to be sent, the newest of each landmark; those of a session before no longer matter."""

    def __init__(self) -> None:
        self._session: int | None = None
        self._landmarks: dict[int | None, Landmark] = {}
        self._removed: set[int] = set()

    def __bool__(self) -> bool:
        return self._session is not None

    def add(self, change: MapChange) -> None:
        if change.session != self._session:
            self._session = change.session
            self._landmarks.clear()
            self._removed.clear()
        for id_ in change.removed:
            self._landmarks.pop(id_, None)
        self._removed.update(change.removed)
        self._landmarks.update((landmark.id, landmark) for landmark in change.landmarks)

    def text(self) -> str:
        """The changes as JSON."""
        rows = list(self._landmarks.values())
        return to_json({"session": self._session, "changed": rows, "removed": sorted(self._removed)}).decode()


class Mailbox:
    """What one client has still to be sent."""

    def __init__(self, points: bool) -> None:
        self._points = points
        self._news = asyncio.Event()
        self._state_changed = False
        self._frame: Frame | None = None
        self._walls: str | None = None
        self._changes = MapChanges()

    def put_change(self, change: MapChange) -> None:
        self._changes.add(change)
        self._news.set()

    def put_state(self) -> None:
        self._state_changed = True
        self._news.set()

    def put_walls(self, text: str) -> None:
        self._walls = text
        self._news.set()

    def put_frame(self, frame: Frame) -> None:
        self._frame = frame
        self._news.set()

    async def take(self, state: Callable[[], str]) -> tuple[list[str], Frame | None]:
        """Wait for news; the messages to send now, made at this moment, and the frame among them."""
        await self._news.wait()
        self._news.clear()
        changed, self._state_changed = self._state_changed, False
        frame, self._frame = self._frame, None
        walls, self._walls = self._walls, None
        messages = [state()] if changed else []
        if self._changes:
            changes, self._changes = self._changes, MapChanges()
            messages.append(typed("landmarks", changes.text()))
        if walls is not None:
            messages.append(typed("walls", walls))
        if frame is not None:
            messages.append(typed("frame", frame_text(frame, self._points)))
        return messages, frame


def typed(kind: str, json: str) -> str:
    """A JSON object with its type as first member; nothing is encoded twice."""
    return f'{{"type":"{kind}",{json[1:]}'
