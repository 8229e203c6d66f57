import asyncio
import json
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from itertools import islice
from pathlib import Path

import httpx
import lidarcore_app.web.stream.mailbox
import numpy as np
import pytest
import websockets
from lidarcore_app.jobs.maps.wall_writer import grid_to_stored
from lidarcore_app.pipeline.newest import NewestScan
from lidarcore_app.web.stream.mailbox import Mailbox
from lidarcore_app.web.transport import SEND_BUFFER
from serving import CORNERS, ROOT, Json, Server, assert_problem, strict_json, write_room
from waiting import PATIENCE

from lidarcore import open_recording
from lidarcore.mapping.grid import build_grid

RECEIVE_BUFFER = 8192
EMPTY = {"format": "lidarcore landmarks", "version": 1, "unit": "m"}
CORNER = {"x": 1, "y": 2, "var_x": 1e-4, "cov_xy": 0, "var_y": 1e-4, "kind": "corner"}


def test_first_comes_the_state_then_the_newest_frame(server: Server) -> None:
    server.next_frame()
    with server.stream() as stream:
        state, frame = stream.message(), stream.message()
    assert state["type"] == "state"
    told = {"settings", "source", "selection", "localization", "recorder", "ready"}
    assert state.keys() == {"type", *told, "sessions_revision", "making_revision"}
    assert state["settings"] == server.get("/settings")
    assert state["source"].keys() == server.get("/source").keys()
    assert state["recorder"] == server.get("/recorder")
    assert frame["type"] == "frame"
    assert frame.keys() - {"type", "points"} == server.get("/frame").keys()


def test_walls_of_the_map_are_told_of_when_they_change_and_to_who_comes_later(server: Server) -> None:
    """The sensor stands still: there is one keyframe, and so one map of walls, for all the frames."""
    server.change("PATCH", "/settings", {"navigation": {"mode": "slam", "method": "scans"}})
    server.play(write_room(server.folder / "long.npz", scans=600))
    with server.stream() as stream:
        told = stream.until("walls", lambda message: len(message["walls"]) == 4)
        for _ in range(10):
            assert stream.message()["type"] != "walls"
        assert told["walls"] == server.get("/walls")["walls"]
        ids = {wall["id"] for wall in told["walls"]}
        for corner in told["corners"]:
            assert set(corner["walls"]) < ids
            assert np.abs(CORNERS - corner["at"]).max(axis=1).min() < 0.02
        assert len(told["corners"]) == 4
        with server.stream() as later:
            assert later.until("walls", bool) == told
        server.change("PATCH", "/settings", {"navigation": {"mode": "off"}})
        assert stream.until("walls", bool) == {"type": "walls", "walls": [], "corners": []}


def test_a_run_that_begins_is_told_of_though_nothing_else_changes(server: Server) -> None:
    """What a known map is localized by is known with the first scan; no counters of a live source bring it along."""
    path = write_room(server.folder / "long.npz", scans=600)
    scans = list(islice(open_recording(path), 5))
    hall = server.app.state.server.landmarks.atlas.begin("hall", 1.0)
    hall.put_walls([], grid_to_stored(build_grid(scans, np.zeros((len(scans), 3)))))
    server.play(path)
    with server.stream() as stream:
        stream.state(lambda state: state["source"]["complete"])  # which is a change, too
        server.change("PATCH", "/settings", {"navigation": {"mode": "localize"}})
        state = stream.state(lambda state: state["localization"]["method"] == "scans")
        newest = stream.frame()["sequence"]
        server.change("PATCH", "/source", {"index": 0})  # the next run is one of the same kind
        while (message := stream.message())["type"] != "frame" or message["sequence"] < newest + 20:
            state = message if message["type"] == "state" else state
        assert state["localization"]["method"] == "scans"
        server.change("PATCH", "/settings", {"navigation": {"mode": "off"}})
        stream.until("state", lambda state: state["localization"]["method"] is None)


def test_another_list_of_sessions_is_told_of_by_another_number(server: Server) -> None:
    atlas = server.app.state.server.landmarks.atlas
    with server.stream() as stream:
        known = stream.state()["sessions_revision"]

        def is_told() -> bool:
            nonlocal known
            before, known = known, atlas.revision
            return bool(stream.state(lambda state: state["sessions_revision"] == known)) and known > before

        id = server.change("POST", "/map", EMPTY | {"landmarks": [CORNER]})["id"]
        assert is_told()
        server.change("PATCH", f"/sessions/{id}", {"name": "Hall"})
        assert is_told()
        server.http.delete(f"/sessions/{id}").raise_for_status()
        assert is_told()
        assert_problem(server.http.delete(f"/sessions/{id}"), 404)
        assert atlas.revision == known


def test_maps_of_recordings_that_are_asked_for_begin_or_end_are_told_of_by_another_number(
    server: Server, room: Path
) -> None:
    with server.stream() as stream:
        known = stream.state()["making_revision"]
        server.change("POST", "/map/making", {"recording": room.name})
        begun = stream.state(lambda state: state["making_revision"] > known)["making_revision"]
        server.http.delete("/map/making").raise_for_status()
        told = stream.state(lambda state: state["making_revision"] >= begun + 2)
        assert told  # that it is cancelled, and that its process has ended


def test_every_change_is_told_to_every_client(server: Server, room: Path) -> None:
    with server.stream() as one, server.stream() as other:
        for method, path, body, holds in [
            (
                "PATCH",
                "/settings",
                {"view": {"theme": "light"}},
                lambda s: s["settings"]["view"]["theme"] == "light",
            ),
            ("PATCH", "/source", {"speed": 2}, lambda s: s["source"]["speed"] == 2),
            ("PATCH", "/source", {"state": "paused"}, lambda s: s["source"]["state"] == "paused"),
            (
                "PUT",
                "/source",
                {"kind": "recording", "name": "room.npz"},
                lambda s: s["source"]["state"] == "playing",
            ),
        ]:
            server.change(method, path, body)
            assert one.state(holds)
            assert other.state(holds)


def test_a_mailbox_holds_one_frame_the_newest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        lidarcore_app.web.stream.mailbox, "frame_text", lambda frame, points: json.dumps(frame)
    )

    async def scenario() -> None:
        mailbox, frames = Mailbox(points=False), [{"n": n} for n in range(5)]
        for frame in frames:
            mailbox.put_frame(frame)
        mailbox.put_state()
        mailbox.put_state()
        messages, frame = await mailbox.take(lambda: "state")
        assert messages == ["state", '{"type":"frame","n": 4}']
        assert frame is frames[4]
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(mailbox.take(lambda: "state"), 0.05)

    asyncio.run(scenario())


def test_a_slot_counts_what_it_drops_but_not_the_same_scan_again() -> None:
    class Taken:
        def __init__(self, scan: object) -> None:
            self.scan = scan

    slot, scans = NewestScan(), [object(), object(), object()]
    for scan in (scans[0], scans[0], scans[1], scans[2]):
        slot.put(Taken(scan))
    assert slot.dropped == 2
    assert slot.take().scan is scans[2]
    assert not slot.idle
    slot.done()
    assert slot.idle


def test_a_slow_client_gets_fewer_frames_and_then_no_old_ones(server: Server) -> None:
    """It stops reading while hundreds of frames pass; what then comes is what fits the sockets, then the newest."""
    write_room(server.folder / "room.npz", scans=300)
    server.change("PATCH", "/source", {"speed": 0})
    server.change("PUT", "/source", {"kind": "recording", "name": "room.npz"})
    slow_socket = socket.socket()
    slow_socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
    slow_socket.connect(("127.0.0.1", server.port))
    passed = threading.Event()
    with server.stream(sock=slow_socket, max_queue=1, close_timeout=0.1) as slow:
        stalled_at = slow.frame()["sequence"]
        server.runtime.frame_listeners.append(lambda f: f.sequence > stalled_at + 400 and passed.set())
        assert passed.wait(60)
        resumed_at = server.runtime.frame.sequence
        late = 0
        while strict_json(text := slow.websocket.recv(timeout=30)).get("sequence", 0) < resumed_at:
            late += len(text)
    in_kernels, in_client = 2 * SEND_BUFFER + 2 * RECEIVE_BUFFER, 65536
    assert late <= in_kernels + in_client + 3 * len(text), "more than the buffers hold came late"
    assert late < 400 * len(text) / 20


@pytest.mark.long
def test_twenty_clients_get_every_frame_in_order_and_memory_does_not_grow(
    tmp_path: Path, free_port: Callable[[], int]
) -> None:
    """In a process of its own, whose memory is its own."""
    room = write_room(tmp_path / "room.npz", scans=100)
    port = free_port()
    command = [
        sys.executable,
        "-m",
        "lidarcore_app.cli.main",
        "serve",
        room,
        "--http-port",
        str(port),
        "--recordings",
        tmp_path,
    ]
    environment = os.environ | {"PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE) as process:
        try:
            assert b"serves" in process.stdout.readline()
            asyncio.run(twenty_clients(f"127.0.0.1:{port}"))
        finally:
            process.terminate()


async def twenty_clients(address: str) -> None:
    async with httpx.AsyncClient(base_url=f"http://{address}/api/v1") as http, asyncio.TaskGroup() as tasks:
        clients = [
            await websockets.connect(f"ws://{address}/api/v1/stream", max_size=None) for _ in range(20)
        ]
        await http.patch("/source", json={"state": "paused"})
        for by in (1, -100):  # what was in the making has been shown then
            at = (await http.post("/source/step", json={"by": by})).json()["index"]
            for client in clients:
                while (await frame(client))["source"]["index"] != at:
                    pass
        memory = [(await http.get("/health")).json()]
        for turn in range(2):
            for at in range(20 * turn + 1, 20 * turn + 21):
                await http.post("/source/step", json={"by": 1})
                seen = [tasks.create_task(frame(client)) for client in clients]
                assert [(await task)["source"]["index"] for task in seen] == 20 * [at]
            memory.append((await http.get("/health")).json())
        assert [m["clients"] for m in memory] == [20, 20, 20]
        grown = memory[2]["memory_bytes"] - memory[1]["memory_bytes"]
        assert grown < 5e6, "20 frames queued for 20 clients would be 6 MB"
        for client in clients:
            await client.close()


async def frame(client: websockets.ClientConnection) -> Json:
    """The next one."""
    while True:
        message: Json = json.loads(await asyncio.wait_for(client.recv(), PATIENCE))
        if message["type"] == "frame":
            return message


def test_a_client_that_goes_is_forgotten(server: Server) -> None:
    with server.stream() as stream:
        stream.frame()
        for _ in range(5):
            with server.stream() as other:
                other.message()
        other.websocket.socket.close()
        stream.frame(lambda _: server.get("/health")["clients"] == 1)
