"""The one place that rests on private parts of viser 1.1.1: if a test here fails, the scene is broken."""

import asyncio
import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

import httpx
import msgspec
import numpy as np
import psutil
import pytest
import viser
import zstandard
from lidarcore_app.web.viser_mount import ViserMount
from serving import CORNERS, Json, Server, wait_until
from starlette.websockets import WebSocketDisconnect
from waiting import PATIENCE
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

NODES = {
    "/body/points",
    "/body/segments",
    "/body/gaps",
    "/body/rejected/points",
    "/trails/estimated",
    "/occupancy",
}


class Viewer:
    """What viser's browser client does with the messages it gets: keep each node's newest properties."""

    def __init__(self, websocket: ClientConnection) -> None:
        self.websocket = websocket
        self.nodes: dict[str, Json] = {}
        self.types: set[str] = set()

    def read(self) -> list[Json]:
        """The next window of messages, taken into account."""
        messages = decode(self.websocket.recv(timeout=PATIENCE))
        for message in messages:
            self.types.add(message["type"])
            name = message.get("name")
            if name is not None and "props" in message:
                self.nodes[name] = message["props"] | {"visible": True}
            elif message["type"] == "SceneNodeUpdateMessage":
                self.nodes[name].update(message["updates"])
            elif message["type"] == "SetSceneNodeVisibilityMessage":
                self.nodes[name]["visible"] = message["visible"]
        return messages

    def until(self, holds: Any) -> None:
        while not holds():
            self.read()

    def array(self, node: str, name: str, kind: str = "<f4") -> np.ndarray:
        return np.frombuffer(self.nodes[node][name], kind)

    def send(self, **message: Any) -> None:
        self.websocket.send(msgspec.msgpack.encode(message))


def decode(window: bytes) -> list[Json]:
    """viser's wire format: sizes, a compressed msgpack, then the arrays it points into, aligned to 8 bytes."""
    size, compressed = struct.unpack_from("<QQ", window)
    data = msgspec.msgpack.decode(zstandard.decompress(window[16 : 16 + compressed], size))
    arrays, at = [], 16 + compressed
    for length in data["binaryBufferLengths"]:
        at += -at % 8
        arrays.append(window[at : at + length])
        at += length

    def filled(value: Any) -> Any:
        if isinstance(value, dict) and "__binary_index" in value:
            return arrays[value["__binary_index"]]
        if isinstance(value, dict):
            return {key: filled(item) for key, item in value.items()}
        return [filled(item) for item in value] if isinstance(value, list) else value

    return [filled(message) for message in data["messages"]]


@contextmanager
def viewing(server: Server) -> Iterator[Viewer]:
    address = f"ws://127.0.0.1:{server.port}/viser"
    with connect(address, subprotocols=[f"viser-v{viser.__version__}"], max_size=None) as websocket:
        yield Viewer(websocket)


def test_the_version_is_the_one_that_the_mount_was_made_for() -> None:
    assert viser.__version__ == "1.1.1"


def test_a_client_gets_the_whole_scene_and_then_every_frame(server: Server, room) -> None:
    server.play(room, paused=True)
    points = np.array(server.get("/frame", points=True)["points"])
    with viewing(server) as viewer:
        viewer.until(lambda: "ReplayDoneMessage" in viewer.types)
        assert viewer.nodes.keys() >= NODES
        shown = viewer.array("/body/points", "points").reshape(-1, 3)
        np.testing.assert_allclose(shown[:, :2], points, atol=1e-4)
        assert viewer.nodes["/body/points"]["precision"] == "float32"
        ends = viewer.array("/body/segments", "points").reshape(-1, 3)[:, :2]
        assert np.linalg.norm(ends[:, None] - CORNERS, axis=2).min(axis=0).max() < 0.1
        server.change("POST", "/source/step", {"by": 1})
        viewer.until(lambda: not np.array_equal(viewer.array("/body/points", "points").reshape(-1, 3), shown))


def test_compare_mode_draws_every_method_in_its_colour(server: Server, room) -> None:
    with viewing(server) as viewer:
        server.change("PATCH", "/settings", {"view": {"compare": True, "methods": ["cwlf", "wctls"]}})
        server.play(room, paused=True)
        viewer.until(lambda: "/body/segments" in viewer.nodes)
        viewer.until(lambda: len(viewer.array("/body/segments", "points")) == 12 * 6)
        viewer.until(lambda: len(viewer.array("/body/segments", "colors", "u1")) == 12 * 6)
        colours = viewer.array("/body/segments", "colors", "u1").reshape(-1, 3)
        assert len(np.unique(colours, axis=0)) == 3


def test_layers_and_theme_reach_the_scene(server: Server, room) -> None:
    server.play(room, paused=True)
    with viewing(server) as viewer:
        viewer.until(lambda: "ReplayDoneMessage" in viewer.types)
        server.change(
            "PATCH", "/settings", {"view": {"layers": {"points": False, "segments": False}, "theme": "light"}}
        )
        viewer.until(
            lambda: not (viewer.nodes["/body/points"]["visible"] or viewer.nodes["/body/segments"]["visible"])
        )
        viewer.until(lambda: "ThemeConfigurationMessage" in viewer.types)


def test_a_localized_sensor_and_what_it_sees_are_drawn_where_it_is(server: Server, room) -> None:
    server.change("PATCH", "/settings", {"navigation": {"mode": "slam", "method": "landmarks"}})
    server.play(room, paused=True)
    server.change(
        "POST",
        "/pose",
        {"x": 10, "y": -5, "heading": np.pi / 2, "sigma_position": 1e-3, "sigma_heading": 1e-3},
    )
    with viewing(server) as viewer:
        viewer.until(lambda: "ReplayDoneMessage" in viewer.types)
        server.change("POST", "/source/step", {"by": 1})
        wait_until(lambda: server.get("/frame")["source"]["index"] == 1)
        x, y = np.array(server.get("/frame", points=True)["points"]).T
        pose = server.get("/pose")
        assert (pose["x"], pose["y"], pose["heading"]) == pytest.approx((10, -5, np.pi / 2), abs=0.02)

        def are_where_it_is() -> bool:
            shown = viewer.array("/body/points", "points").reshape(-1, 3)[:, :2]
            wanted = np.stack([10 - y, -5 + x], -1)
            return shown.shape == wanted.shape and np.allclose(shown, wanted, rtol=0, atol=0.15)

        viewer.until(are_where_it_is)


def look_from_above(viewer: Viewer) -> None:
    """The first camera message makes viser count the client as connected."""
    viewer.send(
        type="ViewerCameraMessage", wxyz=(0.0, 1.0, 0.0, 0.0), position=(0.0, 0.0, 50.0), fov=0.1, near=1.0, far=100.0,
        image_height=600, image_width=800, look_at=(0.0, 0.0, 0.0), up_direction=(0.0, 1.0, 0.0),
    )  # fmt: skip


def test_no_message_but_the_camera_gets_in(server: Server) -> None:
    """The share tunnel would call out, uploads would fill the memory, panels are for all: nothing of it happens."""
    viser_server = server.viser
    with viewing(server) as viewer:
        viewer.until(lambda: "ReplayDoneMessage" in viewer.types)
        look_from_above(viewer)
        viewer.send(type="ShareUrlRequest")
        viewer.send(type="SceneNodeClickMessage", name="/body/points", instance_index=0)
        viewer.send(type="GuiUpdateMessage", uuid="x", updates={"value": 1})
        viewer.send(
            type="FileTransferStartUpload", source_component_uuid="x", transfer_uuid="y", filename="f",
            mime_type="m", part_count=10**9, size_bytes=10**12,
        )  # fmt: skip
        viewer.websocket.send(b"\x00garbage")
        viewer.websocket.send("text")
        viewer.read()
        assert viser_server._share_tunnel is None
        assert not viser_server.gui._current_file_upload_states


def test_a_broken_message_ends_only_the_client_that_sent_it(server: Server) -> None:
    with viewing(server) as good, viewing(server) as bad:
        bad.send(type="ViewerCameraMessage", nonsense=True)
        with pytest.raises(ConnectionClosed):
            bad.until(lambda: False)
        good.until(lambda: "ReplayDoneMessage" in good.types)
        assert good.read()


def test_a_client_that_is_gone_when_it_is_given_up_is_no_error(server: Server, monkeypatch) -> None:
    class Gone:
        scope: ClassVar = {"subprotocols": ["viser-v1.1.1"]}

        async def accept(self, subprotocol: str) -> None:
            pass

        async def close(self, code: int) -> None:
            raise WebSocketDisconnect(code)

    async def refusing(connection: object) -> None:
        raise KeyError("look_au")

    monkeypatch.setattr(server.mount, "_handler", refusing)
    asyncio.run(server.mount._serve(Gone()))


@pytest.mark.parametrize("protocols", [["viser-v0.0.1"], None])
def test_a_client_of_another_version_is_told_so(server: Server, protocols: list | None) -> None:
    with connect(f"ws://127.0.0.1:{server.port}/viser", subprotocols=protocols) as websocket:
        with pytest.raises(ConnectionClosed) as closed:
            websocket.recv(timeout=PATIENCE)
        assert closed.value.rcvd.code == 1002


def test_viser_opens_no_port(server: Server) -> None:
    server.next_frame()
    listening = {
        c.laddr.port for c in psutil.Process().net_connections("inet") if c.status == psutil.CONN_LISTEN
    }
    assert listening == {server.port}


def test_the_client_page_is_ours_first_and_calls_nobody(server: Server) -> None:
    page = httpx.get(f"{server.url}/viser/")
    html = page.text
    assert html.index("viser_bridge.js") < html.index("<script", html.index("viser_bridge.js") + 1)
    assert "unsafe-eval'" not in page.headers["content-security-policy"].replace("wasm-unsafe-eval'", "")
    assert not re.findall(r"<(?:script|link)[^>]+(?:src|href)=\"?https?:", html)
    assert httpx.get(f"{server.url}/static/viser_bridge.js").status_code == 200
    assert httpx.get(f"{server.url}/viser").status_code == 307
    assert len(html) > 500_000


def test_what_is_drawn_wakes_connections_on_their_own_event_loop() -> None:
    """asyncio itself says so: in debug mode its loops refuse what another thread does to those who wait."""
    mount = ViserMount()
    try:
        loop, buffer = mount.server.get_event_loop(), mount.server._websock_server.get_message_buffer()

        async def debug_from_now_on() -> None:
            loop.set_debug(True)
            buffer.message_event.clear()

        asyncio.run_coroutine_threadsafe(debug_from_now_on(), loop).result(PATIENCE)
        woken = asyncio.run_coroutine_threadsafe(buffer.message_event.wait(), loop)
        wait_until(lambda: buffer.message_event._waiters, "a connection waits")
        mount.server.scene.world_axes.visible = True
        assert woken.result(PATIENCE)
    finally:
        mount.close()


def test_viewers_come_and_go_without_a_trace(server: Server) -> None:
    states = server.viser._websock_server._client_state_from_id
    for _ in range(10):
        with viewing(server) as viewer:
            viewer.read()
        with viewing(server) as viewer:
            viewer.read()
            viewer.websocket.socket.close()
    with server.stream() as stream:
        stream.frame(lambda _: not states)
