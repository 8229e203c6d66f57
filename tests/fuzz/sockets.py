"""Broken messages to both WebSockets: none of them may cost anybody else an answer."""

import contextlib
import json
import logging
import random
import time
from socket import SHUT_RDWR

import httpx
import msgspec
from findings import Findings
from mutation import mutated
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

PATIENCE = 10.0  # s
logging.getLogger("websockets.client").setLevel(logging.CRITICAL)  # what it says of closing without a word
POSE = json.dumps({"type": "odometry", "stamp": 1e9, "x": 1.0, "y": 2.0, "heading": 0.5}).encode()
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0.0, 0.0, 1.0], "fov": 1.0,
    "near": 0.1, "far": 10.0, "look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 0.0, 1.0], "image_height": 100,
    "image_width": 100,
}  # fmt: skip
SOCKETS = (("/api/v1/stream", POSE, None), ("/viser", msgspec.msgpack.encode(CAMERA), ["viser-v1.1.1"]))


def fuzz(address: str, seconds: float, findings: Findings) -> None:
    """A client each round that sends some messages and goes; then somebody else asks for something."""
    with httpx.Client(base_url=address, timeout=PATIENCE) as http:
        for name, rng in findings.rounds("sockets", seconds):
            path, sound, protocols = rng.choice(SOCKETS)
            began = time.monotonic()
            with contextlib.suppress(WebSocketException, OSError):  # it may well be thrown out
                _send(address.replace("http", "ws", 1) + path, sound, protocols, rng)
            try:
                http.get("/api/v1/version").raise_for_status()
                http.get("/api/v1/localization").raise_for_status()
            except httpx.HTTPError as error:
                findings.add(name, path, error)
            if (took := time.monotonic() - began) > PATIENCE:
                findings.add(name, path, f"took {took:.0f} s")


def _send(url: str, sound: bytes, protocols: list[str] | None, rng: random.Random) -> None:
    with connect(url, subprotocols=protocols, proxy=None, max_size=None, close_timeout=1) as socket:  # type: ignore[arg-type]
        for _ in range(rng.choice((1, 5, 200))):
            data = mutated(sound, rng)
            is_text = rng.random() < 0.5
            socket.send(data.decode("utf-8", "replace") if is_text else data)
        if rng.random() < 0.5:
            socket.recv(timeout=PATIENCE)
        if rng.random() < 0.2:
            socket.socket.shutdown(SHUT_RDWR)  # without a word
