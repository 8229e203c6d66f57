"""What the Repeatability tab costs a running server: the same one with it off and on, in turn."""

import json
import threading
import time
from contextlib import suppress
from dataclasses import dataclass

import httpx
import psutil
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from lidarcore.evaluation.intervals import Interval, mean
from lidarcore.evaluation.repeatability.statistics import WINDOW

from .server_load import SETTLE, server

POLL = 1.0  # s, as the page does
LIMIT_PERCENT = 10.0  # of a core


@dataclass(frozen=True, slots=True)
class Added:
    """CPU % of a core by the server: without the tab, with it, and what it adds."""

    off: Interval
    on: Interval
    added: Interval


def measure_repeatability(seconds: float, rounds: int) -> Added:
    """Serve an emulated sensor to a browser that has the tab open, with a full window of scans by all methods."""
    with (
        server() as (process, port),
        httpx.Client(base_url=f"http://127.0.0.1:{port}/api/v1", timeout=60) as http,
    ):
        _look_on(port)
        pairs = [
            [_percent(process, http, running, seconds) for running in (False, True)] for _ in range(rounds)
        ]
    off, on = zip(*pairs, strict=True)
    return Added(mean(off), mean(on), mean([b - a for a, b in pairs]))


def _look_on(port: int) -> None:
    """Receive frames, as a page does, until the server ends; return when the first one has come."""
    stream = connect(f"ws://127.0.0.1:{port}/api/v1/stream", proxy=None, max_size=None)
    while json.loads(stream.recv())["type"] != "frame":
        pass
    threading.Thread(target=_receive, args=(stream,), daemon=True).start()


def _receive(stream: ClientConnection) -> None:
    with suppress(ConnectionClosed):
        for _ in stream:
            pass


def _percent(process: psutil.Process, http: httpx.Client, running: bool, seconds: float) -> float:
    http.patch("/settings", json={"repeatability": {"running": running}}).raise_for_status()
    time.sleep(SETTLE)
    while running and _poll(http) < WINDOW:
        time.sleep(POLL)
    cpu, begin = sum(process.cpu_times()[:2]), time.monotonic()
    while (elapsed := time.monotonic() - begin) < seconds:
        time.sleep(POLL)
        if running:
            _poll(http)
    return 100 * float(sum(process.cpu_times()[:2]) - cpu) / elapsed


def _poll(http: httpx.Client) -> int:
    """Ask what the page asks; returns the scans in the window."""
    summary = http.get("/repeatability").raise_for_status().json()
    corners = [corner["id"] for method in summary["methods"] for corner in method["corners"]]
    if corners:
        http.get(f"/repeatability/corners/{corners[0]}")
    return int(summary["scans"])
