"""Frames, walls and changes of the map from the threads that make them to the clients that watch."""

import asyncio
from collections.abc import Callable
from dataclasses import asdict
from typing import Literal

from pydantic import ValidationError
from pydantic_core import to_json
from starlette.websockets import WebSocket, WebSocketDisconnect

from lidarcore.errors import LocalizationError
from lidarcore.mapping.walls import WallTable

from ...errors import explained
from ...jobs.maps.maker import MapMaker
from ...jobs.maps.session_writer import MapChange
from ...jobs.maps.store import LandmarkStore
from ...jobs.recorder import AsyncRecorder
from ...pipeline.frame import Frame
from ...pipeline.runtime import Runtime
from ..answers.wall_json import walls_text
from ..schemas import OdometryPose
from .mailbox import Mailbox, typed

TICK = 0.5  # s
PENALTY = 0.01  # s until the next message is read of a client whose last one was not taken


class OdometryMessage(OdometryPose):
    """What a client may send: a pose, with its type."""

    type: Literal["odometry"]


class Hub:
    """Hands what the runtime's threads produce to the clients on the event loop."""

    def __init__(
        self,
        runtime: Runtime,
        recorder: AsyncRecorder,
        landmarks: LandmarkStore,
        map_maker: MapMaker,
        sent: Callable[[Frame], None],
    ) -> None:
        """`sent` is told of every frame that was handed to a browser's socket."""
        self._runtime, self._recorder, self._sent = runtime, recorder, sent
        self._landmarks, self._map_maker = landmarks, map_maker
        self._mailboxes: set[Mailbox] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._session: int | None = None  # that was written to last
        self._walls: WallTable | None = None  # of the map that the newest frame shows
        runtime.frame_listeners.append(self._shown)
        landmarks.listeners.append(self._written)
        for listeners in (runtime.change_listeners, landmarks.atlas.listeners, map_maker.listeners):
            listeners.append(lambda: self._post(Mailbox.put_state))

    @property
    def clients(self) -> int:
        return len(self._mailboxes)

    def open(self) -> None:
        """Deliver from now on, on the running event loop."""
        self._loop = asyncio.get_running_loop()
        self._ticking = self._loop.create_task(self._tick())

    def close(self) -> None:
        self._ticking.cancel()
        self._loop = None

    def state(self) -> str:
        """Everything but the frames, as a message."""
        runtime = self._runtime
        state = {
            "settings": runtime.settings.model_dump(),
            "source": runtime.player.status(),
            "selection": asdict(runtime.selection),
            "localization": runtime.localization(),
            "recorder": self._recorder.status,
            "ready": runtime.ready,
            "sessions_revision": self._landmarks.atlas.revision,
            "making_revision": self._map_maker.revision,
        }
        return typed("state", to_json(state).decode())

    async def serve(self, websocket: WebSocket, points: bool) -> None:
        """Feed one accepted client until it goes."""
        mailbox = Mailbox(points)
        mailbox.put_state()
        if (newest := self._runtime.frame) is not None:
            mailbox.put_frame(newest)
            if (walls := _walls_of(newest)) is not None:
                mailbox.put_walls(walls_text(walls))
        self._mailboxes.add(mailbox)
        sender = asyncio.create_task(self._send(websocket, mailbox))
        receiver = asyncio.create_task(self._receive(websocket))
        try:
            await asyncio.wait((sender, receiver), return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._mailboxes.discard(mailbox)
            sender.cancel()
            receiver.cancel()
            await asyncio.gather(sender, receiver, return_exceptions=True)

    async def _send(self, websocket: WebSocket, mailbox: Mailbox) -> None:
        while True:
            messages, frame = await mailbox.take(self.state)
            for message in messages:
                await websocket.send_text(message)
            if frame is not None:
                self._sent(frame)

    async def _receive(self, websocket: WebSocket) -> None:
        """Take odometry; say what is wrong with anything else, and go on until the client goes.

        Who sends nonsense or too much has to wait: the socket fills up, and it is the client who notices.
        """
        try:
            while (message := await websocket.receive())["type"] != "websocket.disconnect":
                try:
                    pose = OdometryMessage.model_validate_json(message.get("text") or "")
                    is_taken = self._runtime.feed(pose.stamp, (pose.x, pose.y, pose.heading))
                except (ValidationError, LocalizationError) as error:
                    is_taken = False
                    why = explained(error) if isinstance(error, ValidationError) else str(error)
                    await websocket.send_text(_refusal(why))
                if not is_taken:
                    await asyncio.sleep(PENALTY)
        except (WebSocketDisconnect, RuntimeError):
            return

    async def _tick(self) -> None:
        """The counters of a live source, and the size of a recording, change all the time."""
        while True:
            await asyncio.sleep(TICK)
            if self._runtime.player.source.live or self._recorder.running:
                self._deliver(Mailbox.put_state)

    def _shown(self, frame: Frame) -> None:
        """The walls of its map are other ones about once a second; they are told of only then, before the frame."""
        if (walls := _walls_of(frame)) is not self._walls:
            self._walls = walls
            self._post(Mailbox.put_walls, walls_text(walls))
        self._post(Mailbox.put_frame, frame)

    def _written(self, change: MapChange) -> None:
        """A map is told of first when its first landmark is on the disk: only now it has a session."""
        if change.session != self._session:
            self._session = change.session
            self._post(Mailbox.put_state)
        self._post(Mailbox.put_change, change)

    def _post(self, put: Callable[..., None], *args: object) -> None:
        loop = self._loop
        if loop is not None and not loop.is_closed():
            loop.call_soon_threadsafe(self._deliver, put, *args)

    def _deliver(self, put: Callable[..., None], *args: object) -> None:
        for mailbox in self._mailboxes:
            put(mailbox, *args)


def _walls_of(frame: Frame) -> WallTable | None:
    return frame.picture.walls if frame.picture else None


def _refusal(detail: str) -> str:
    problem = {"title": "Message ignored", "detail": detail}
    return typed("error", to_json(problem).decode())
